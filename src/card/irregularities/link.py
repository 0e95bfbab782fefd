"""The irregularities stage: each label with its height profile, its track and its place on the map."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure, progress, read_arrays, read_json, read_table, write_report, write_table
from card.geometry import CameraModel, Roads, Trajectory, apply, from_json, height_above_road
from card.irregularities.profile import AGREES, DOUBTFUL, UNKNOWN, Profile, View, box_profile
from card.irregularities.tables import box_columns, nearest_judged, track_columns
from card.irregularities.tracks import track_boxes

Array = NDArray[np.float64]

MOST_NOTES = 20


def link_irregularities(
    *,
    labels: Path,
    frames: Path,
    calibration: Path,
    trajectory: Path,
    ground_truth: Path,
    road_planes: Path,
    irregularities: Path,
    tracks: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write what the ground truth says of each labelled box, and which boxes show the same irregularity.

    Parameters
    ----------
    labels, frames, calibration, trajectory, road_planes : artifacts of the schemas of these names.
    ground_truth : folder of the frames' points, ``<frame:06d>.npz``.
    irregularities, tracks : tables ``irregularities`` and ``irregularity_tracks`` to write.

    Raises
    ------
    CardError
        For inputs that do not fit their schemas, or a trajectory that does not cover a labelled frame.
    """
    scene = _Scene(calibration, frames, road_planes, ground_truth, settings)
    path = Trajectory.from_table(read_table(trajectory, "trajectory"))
    rows = read_table(labels, "labels").to_pylist()
    profiles: list[Profile] = []
    places = np.full((len(rows), 3), np.nan)
    by_frame = [(frame, list(boxes)) for frame, boxes in groupby(rows, key=lambda row: row["frame"])]
    for frame, boxes in progress(by_frame, "irregularities"):
        view = scene.view(frame)
        world_from_rig = path.at(np.array([scene.t_ns[frame]]))[0]
        for row in boxes:
            profile = scene.profile(view, row)
            if profile.place is not None:
                places[len(profiles)] = apply(world_from_rig, profile.place)
            profiles.append(profile)
    distances = np.array([np.nan if p.distance_m is None else p.distance_m for p in profiles])
    found = track_boxes(
        [row["frame"] for row in rows],
        [row["class"] for row in rows],
        places[:, :2],
        distances,
        np.array([profile.spread_m for profile in profiles]),
        settings["track_radius_m"],
        settings["track_radius_per_m"],
    )
    write_table(irregularities, box_columns(rows, profiles, places, found), "irregularities")
    write_table(tracks, track_columns(rows, profiles, places, found), "irregularity_tracks")
    inputs = {"labels": labels, "frames": frames, "calibration": calibration, "trajectory": trajectory}
    write_report(
        report,
        stage="irregularities",
        sequence=report.parent.name,
        settings=settings,
        inputs={**inputs, "road_planes": road_planes},
        counts=_counts(rows, profiles, found),
        figures=_figures(profiles),
        gates=gates,
        notes=_review_list(rows, profiles, found),
    )


class _Scene:
    """The camera, the road planes and the ground truth of a sequence."""

    def __init__(
        self,
        calibration: Path,
        frames: Path,
        road_planes: Path,
        ground_truth: Path,
        settings: Mapping[str, Any],
    ) -> None:
        bundle = read_json(calibration, "calibration")
        table = read_table(frames, "frames")
        self.t_ns = dict(zip(table["frame"].to_pylist(), table["t_ns"].to_pylist(), strict=True))
        self._camera = CameraModel.from_json(bundle["cameras"]["camera_left"])
        self._rig_from_camera = from_json(bundle["extrinsics"]["rig_from_camera_left"])
        self._ground_z = float(np.mean([wheel["contact_m"][2] for wheel in bundle["wheels"].values()]))
        self._roads = Roads.from_table(read_table(road_planes, "road_planes")).by_frame()
        self._folder = ground_truth
        self._settings = settings

    def view(self, frame: int) -> View:
        """The points of a frame that are near the road; none where it has no ground truth."""
        file = self._folder / f"{frame:06d}.npz"
        points = (
            read_arrays(file, "ground_truth_points")["points"] if file.is_file() else np.zeros((0, 3))
        ).astype(np.float64)
        rig = apply(self._rig_from_camera, points)
        band = self._settings["band_m"] + self._settings["band_per_m"] * np.hypot(rig[:, 0], rig[:, 1])
        near = np.abs(rig[:, 2] - self._ground_z) <= band
        road = self._roads.get(frame)
        height = np.full(int(near.sum()), np.nan) if road is None else height_above_road(rig[near], road)
        return View(self._camera.project(points[near]), rig[near], height)

    def profile(self, view: View, row: Mapping[str, Any]) -> Profile:
        """Profile of a row of ``labels``; without points its place is where the view meets the road."""
        size = np.array([self._camera.width, self._camera.height])
        centre = np.array([row["x_center"], row["y_center"]]) * size - 0.5
        half = np.array([row["width"], row["height"]]) * size / 2
        edges = np.concatenate([centre - half, centre + half])
        profile = box_profile(view, edges, row["class"], self._settings)
        if profile.place is None:
            return replace(profile, place=self._on_level_ground(centre))
        return profile

    def _on_level_ground(self, pixel: Array) -> Array | None:
        """Where the ray of a pixel meets the level ground under the wheels, (3,) rig; None at the horizon."""
        ray = self._rig_from_camera[:3, :3] @ self._camera.rays(pixel[None])[0]
        origin = self._rig_from_camera[:3, 3]
        reach = (self._ground_z - origin[2]) / ray[2] if ray[2] < 0 else np.inf
        place: Array = origin + reach * ray if np.isfinite(reach) else origin
        if not np.isfinite(reach) or np.hypot(*place[:2]) > self._settings["max_distance_m"]:
            return None
        return place


def _counts(
    rows: Sequence[Mapping[str, Any]], profiles: Sequence[Profile], found: NDArray[np.int64]
) -> dict[str, int]:
    tally = Counter((row["class"], profile.verdict) for row, profile in zip(rows, profiles, strict=True))
    names = [(name, verdict) for name in ("positive", "negative") for verdict in (AGREES, DOUBTFUL, UNKNOWN)]
    return {
        "boxes": len(rows),
        "tracks": int(found.max(initial=-1)) + 1,
        "tracks_doubtful": sum(
            profiles[best].verdict == DOUBTFUL for best in nearest_judged(profiles, found).values()
        ),
        "boxes_without_place": int((found < 0).sum()),
        **{f"{name}_{verdict}": tally[name, verdict] for name, verdict in names},
    }


def _figures(profiles: Sequence[Profile]) -> list[Figure]:
    judged = [profile for profile in profiles if profile.verdict != UNKNOWN]
    return [
        Figure(
            "boxes_judged_pct",
            100 * len(judged) / len(profiles) if profiles else None,
            "%",
            "Share of the boxes with enough ground truth inside and around.",
        ),
        Figure(
            "boxes_agreeing_pct",
            100 * sum(profile.verdict == AGREES for profile in judged) / len(judged) if judged else None,
            "%",
            "Share of these whose ground truth rises (positive) or falls (negative) as labelled.",
        ),
    ]


def _review_list(
    rows: Sequence[Mapping[str, Any]], profiles: Sequence[Profile], found: NDArray[np.int64]
) -> list[str]:
    """A line for each irregularity that a person should look at again: doubtful even from nearby."""
    lines = []
    for track, best in nearest_judged(profiles, found).items():
        row, profile = rows[best], profiles[best]
        if profile.verdict == DOUBTFUL:
            up, down = 100 * (profile.elevation_m or 0), 100 * (profile.depression_m or 0)
            wanted = "elevation" if row["class"] == "positive" else "depression"
            where = f"frame {row['frame']}, x {row['x_center']:.3f}, y {row['y_center']:.3f}"
            what = f"{row['class']} without {wanted}: {up:+.1f} cm, {-down:+.1f} cm"
            lines.append(f"{where} (track {track}): {what}")
    more = len(lines) - MOST_NOTES
    return lines[:MOST_NOTES] + ([f"and {more} more, verdict doubtful in the table"] if more > 0 else [])
