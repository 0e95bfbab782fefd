"""How near the frames of a test set are to those a method may have trained on."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from card.splits.tracks import Track

Row = Mapping[str, Any]


def leakage_columns(
    rows: Sequence[Row], tracks: Mapping[str, Track], places: Mapping[str, str]
) -> dict[str, list[Any]]:
    """Columns of `split_leakage`: for each test frame the distance to the nearest training frame.

    Parameters
    ----------
    rows : {sequence, frame, split} of all frames. tracks : by sequence; places : of each sequence.

    A frame is `measured` where its map has training frames, `apart` where nothing of its place is trained
    on, and `unknown` where something is but no common map tells how far away.
    """
    from scipy.spatial import cKDTree

    train: dict[str, list[Any]] = {}
    trained_places = {places[row["sequence"]] for row in rows if row["split"] == "train"}
    index = {
        name: dict(zip(track.frames.tolist(), track.places_m, strict=True)) for name, track in tracks.items()
    }
    for row in rows:
        place = index.get(row["sequence"], {}).get(row["frame"])
        if row["split"] == "train" and place is not None:
            train.setdefault(tracks[row["sequence"]].map, []).append((place, row))
    trees = {name: cKDTree(np.array([place for place, _ in found])) for name, found in train.items()}
    names = ("sequence", "frame", "state", "distance_m", "train_sequence", "train_frame")
    columns: dict[str, list[Any]] = {name: [] for name in names}
    for row in rows:
        if row["split"] != "test":
            continue
        place = index.get(row["sequence"], {}).get(row["frame"])
        map_name = tracks[row["sequence"]].map if place is not None else None
        cells: tuple[Any, ...]
        if map_name in trees:
            distance, nearest = trees[map_name].query(place)
            other = train[map_name][int(nearest)][1]
            cells = ("measured", float(distance), other["sequence"], other["frame"])
        else:
            near = places[row["sequence"]] in trained_places
            cells = ("unknown" if near else "apart", None, None, None)
        for name, value in zip(names, (row["sequence"], row["frame"], *cells), strict=True):
            columns[name].append(value)
    return columns


def percentile_m(columns: Mapping[str, Sequence[Any]], percent: float) -> float | None:
    """Percentile of the distances in metres, `apart` as infinite; None where it is, or nothing is known."""
    distances = [
        np.inf if state == "apart" else distance
        for state, distance in zip(columns["state"], columns["distance_m"], strict=True)
        if state != "unknown"
    ]
    if not distances:
        return None
    value = float(np.percentile(distances, percent, method="lower"))
    return value if np.isfinite(value) else None
