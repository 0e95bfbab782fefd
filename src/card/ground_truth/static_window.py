"""The static points of the bursts round consecutive frames, kept in memory while frames go by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.geometry import inverse
from card.ground_truth import window_rows
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.selection import Selection, diagonal
from card.ground_truth.static_set import StaticSet
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxels import find
from card.ground_truth.window_cleaning import clean
from card.ground_truth.window_view import View, emit, look

Ordinals = npt.NDArray[np.int64]


class _StaticBurst(NamedTuple):
    """voxel: (N,) int32 positions in the static set. offset: (N, 3) float32. total: points, static or not."""

    voxel: npt.NDArray[np.int32]
    offset: npt.NDArray[np.float32]
    total: int


class StaticWindow:
    """Takes the points of a frame out of its windows; `reference.selection` is the same in plain numpy.

    `open` brings the bursts of the next frames into memory, ordered by voxel; `select` goes through those
    frames in order of time. Only voxels that changed since the last frame are cleaned again.
    """

    def __init__(
        self,
        drive: Drive,
        static: StaticSet,
        camera: LeftCamera,
        settings: Mapping[str, Any],
    ) -> None:
        self._drive, self._static, self._camera, self._settings = drive, static, camera, settings
        self._workspace = Workspace()
        self._bursts: dict[int, _StaticBurst] = {}
        # Number of each static voxel among those that the open bursts hit, -1 for the others.
        self._local = np.full(len(static.keys), -1, dtype=np.int32)
        self._found = np.empty(0, dtype=np.int32)

    def open(self, bursts: Ordinals) -> None:
        """Hold these bursts (B,), increasing ordinals, and no others: all that frames need until the next."""
        self._bursts = {int(i): self._bursts.get(int(i)) or self._load(int(i)) for i in bursts}
        self._local[self._found] = -1
        found = np.empty(
            min(len(self._local), sum(len(b.voxel) for b in self._bursts.values())), dtype=np.int32
        )
        count = 0
        for burst in self._bursts.values():
            count = window_rows.number(burst.voxel, self._local, found, count)
        self._found = found[:count].copy()
        self._rows = self._fill()
        self._queue = [
            [int(i) for i in bursts[self._drive.front[bursts] == front]] for front in (True, False)
        ]
        self._entered, self._left = [0, 0], [0, 0]

    def _fill(self) -> window_rows.Rows:
        sizes = np.zeros(2 * len(self._found), dtype=np.int64)
        for i, burst in self._bursts.items():
            window_rows.measure(burst.voxel, self._local, self._sensor(i), sizes)
        start = np.concatenate([[0], np.cumsum(sizes)])
        take, points = self._workspace.take, int(start[-1])
        rows = window_rows.Rows(
            start=start,
            head=start[:-1].copy(),
            tail=start[:-1].copy(),
            offset=take("row offset", (points, 3), np.float32),
            burst=take("row burst", points, np.int32),
            kept=take("row kept", points, np.bool_),
            changed=np.ones(len(self._found), dtype=np.bool_),
            clean=np.zeros(len(self._found), dtype=np.int64),
            left=np.zeros(len(self._found), dtype=np.int64),
            corner=self._static.grid.corners(self._static.keys[self._found]),
            mean=np.zeros((len(self._found), 3)),
            spread=np.zeros((len(self._found), 6)),
        )
        end = start[:-1].copy()
        for i, burst in self._bursts.items():
            window_rows.fill(burst.voxel, burst.offset, self._local, self._sensor(i), i, end, rows)
        return rows

    def select(
        self, bursts: Ordinals, keyframe_burst: int, world_from_rig: npt.NDArray[np.float64]
    ) -> Selection:
        """Clean and crop the static points of bursts (B,): those of one frame's windows, among the open ones.

        keyframe_burst : ordinal of the keyframe burst, or -1. world_from_rig : (4, 4) at the image's time.
        The arrays of the result are overwritten by the next call.
        """
        for sensor, front in enumerate((True, False)):
            self._slide(sensor, bursts[self._drive.front[bursts] == front])
        rows, settings, take = self._rows, self._settings, self._workspace.take
        view = self._view(world_from_rig)
        box = np.empty((2, 3))
        near = take("near voxels", len(self._found), np.int32)
        listed, redundant, points_near = look(
            rows, view, self._static.grid.size, settings["min_lidars_per_voxel"], near, box
        )
        near = near[:listed]
        most = int((rows.start[2::2] - rows.start[:-2:2]).max(initial=0))
        inliers, most_points = clean(
            rows,
            near,
            settings["mad_multiplier"],
            settings["mad_form"] == "literal",
            settings["mad_form"] == "off",
            settings["mad_min_inliers"],
            settings["points_per_voxel"],
            take("place", most, np.int64),
            take("radius", most, np.float32),
            take("sorted", most, np.float32),
        )
        points = take("points", (most_points + 1, 3), np.float64)
        own = take("own", most_points + 1, np.bool_)
        thinned, in_view, count = emit(
            rows, near, view, float(settings["pixels_per_point"]), keyframe_burst, points, own
        )
        counts = {
            "points_window": sum(self._bursts[int(i)].total for i in bursts),
            "points_static": sum(len(self._bursts[int(i)].voxel) for i in bursts),
            "points_two_lidars": redundant,
            "points_near_view": points_near,
            "points_clean": inliers,
            "points_thinned": thinned,
            "points_in_view": in_view,
            "points_not_ego": count,
        }
        return Selection(points[:count], own[:count], diagonal(box) if redundant else 0.0, counts)

    def _slide(self, sensor: int, wanted: Ordinals) -> None:
        """Let the bursts of one LiDAR into the window up to the last one wanted, and out before the first."""
        queue, rows = self._queue[sensor], self._rows
        while (
            len(wanted) and self._entered[sensor] < len(queue) and queue[self._entered[sensor]] <= wanted[-1]
        ):
            burst = self._bursts[queue[self._entered[sensor]]]
            window_rows.move(burst.voxel, self._local, sensor, rows.tail, rows.changed)
            self._entered[sensor] += 1
        first = wanted[0] if len(wanted) else np.inf
        while self._left[sensor] < self._entered[sensor] and queue[self._left[sensor]] < first:
            burst = self._bursts[queue[self._left[sensor]]]
            window_rows.move(burst.voxel, self._local, sensor, rows.head, rows.changed)
            self._left[sensor] += 1
        assert self._entered[sensor] - self._left[sensor] == len(wanted), "frames must come in order of time"

    def _view(self, world_from_rig: npt.NDArray[np.float64]) -> View:
        camera_from_world = inverse(world_from_rig @ self._camera.rig_from_camera)
        low, high = self._camera.bounds(self._settings["view_margin_rad"])
        image = self._camera.undistorted
        return View(
            rotation=np.ascontiguousarray(camera_from_world[:3, :3]),
            translation=np.ascontiguousarray(camera_from_world[:3, 3]),
            low=low,
            high=high,
            nearest=float(self._settings["nearest_depth_m"]),
            fx=image.fx,
            fy=image.fy,
            cx=image.cx,
            cy=image.cy,
            ego=self._camera.ego,
            ego_top=self._camera.ego_top,
        )

    def _sensor(self, i: int) -> int:
        return 0 if self._drive.front[i] else 1

    def _load(self, i: int) -> _StaticBurst:
        points = self._drive.sweep(i).points
        keys = self._static.grid.keys(points)
        voxel = find(self._static.keys, keys)
        inside = voxel >= 0
        offset = points[inside] - self._static.grid.corners(keys[inside])
        return _StaticBurst(voxel[inside].astype(np.int32), offset.astype(np.float32), len(points))
