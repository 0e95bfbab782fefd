"""The tables of the irregularities stage."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.irregularities.profile import AGREES, DOUBTFUL, UNKNOWN, Profile

Array = NDArray[np.float64]
HEIGHTS = ("height_max_m", "height_min_m", "relief_m", "elevation_m", "depression_m")


def box_columns(
    rows: Sequence[Mapping[str, Any]],
    profiles: Sequence[Profile],
    places: Array,
    tracks: NDArray[np.int64],
) -> dict[str, list[Any]]:
    """Columns of table ``irregularities``: one row a row of ``labels``, in the same order."""
    ordinals: dict[int, int] = {}
    boxes = []
    for row in rows:
        boxes.append(ordinals.get(row["frame"], 0))
        ordinals[row["frame"]] = boxes[-1] + 1
    return {
        "frame": [row["frame"] for row in rows],
        "box": boxes,
        "class": [row["class"] for row in rows],
        "track": [None if track < 0 else track for track in tracks.tolist()],
        "points": [profile.points for profile in profiles],
        **{name: [getattr(profile, name) for profile in profiles] for name in HEIGHTS},
        "distance_m": [profile.distance_m for profile in profiles],
        "verdict": [profile.verdict for profile in profiles],
        **{axis: _nullable(places[:, i]) for i, axis in enumerate("xyz")},
    }


def track_columns(
    rows: Sequence[Mapping[str, Any]],
    profiles: Sequence[Profile],
    places: Array,
    tracks: NDArray[np.int64],
) -> dict[str, list[Any]]:
    """Columns of table ``irregularity_tracks``; place and heights are those of the nearest judged sight."""
    columns: dict[str, list[Any]] = {
        name: []
        for name in (
            "track",
            "class",
            "boxes",
            "first_frame",
            "last_frame",
            "x",
            "y",
            "z",
            "nearest_m",
            "elevation_m",
            "depression_m",
            AGREES,
            DOUBTFUL,
        )
    }
    bests = nearest_judged(profiles, tracks)
    for track in bests:
        members = np.flatnonzero(tracks == track).tolist()
        best = bests[track]
        verdicts = [profiles[i].verdict for i in members]
        values = (
            track,
            rows[best]["class"],
            len(members),
            min(rows[i]["frame"] for i in members),
            max(rows[i]["frame"] for i in members),
            *places[best].tolist(),
            min(profiles[i].distance_m or 0.0 for i in members),
            profiles[best].elevation_m,
            profiles[best].depression_m,
            verdicts.count(AGREES),
            verdicts.count(DOUBTFUL),
        )
        for name, value in zip(columns, values, strict=True):
            columns[name].append(value)
    return columns


def nearest_judged(profiles: Sequence[Profile], tracks: NDArray[np.int64]) -> dict[int, int]:
    """By track the nearest of its boxes that could be judged, or of all where none could."""
    return {
        track: min(
            np.flatnonzero(tracks == track).tolist(),
            key=lambda i: (profiles[i].verdict == UNKNOWN, profiles[i].distance_m or 0.0),
        )
        for track in range(int(tracks.max(initial=-1)) + 1)
    }


def _nullable(values: Array) -> list[float | None]:
    return [None if np.isnan(value) else value for value in values.tolist()]
