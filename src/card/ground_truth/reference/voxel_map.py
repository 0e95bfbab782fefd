"""The voxel map in plain numpy: the same arrays as `ground_truth.voxel_map`, to the last bit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.reference.views import distinct_views
from card.ground_truth.voxel_map import VoxelMap, centroids, extents
from card.ground_truth.voxel_table import MAX_SPAN
from card.ground_truth.voxels import OFFSET_STEPS, VoxelGrid

#: Points sorted at once; the result does not depend on it.
CHUNK_POINTS = 2_000_000


def build_voxel_map(
    bursts: Iterable[tuple[int, bool, npt.NDArray[np.float64]]],
    origins: npt.NDArray[np.float64],
    grid: VoxelGrid,
    settings: Mapping[str, Any],
    chunk_points: int = CHUNK_POINTS,
) -> VoxelMap:
    """The map of a drive's bursts, given in the fixed order (end time, sensor, index).

    Parameters
    ----------
    bursts : ordinal (increasing), whether it is the front LiDAR's, world points (N, 3) metres.
    origins : (B, 3) sensor origin of each ordinal in world, metres.
    """
    state = _State(origins, grid, settings)
    pending: list[tuple[int, bool, npt.NDArray[np.float64]]] = []
    points = 0
    for burst in bursts:
        pending.append(burst)
        points += len(burst[2])
        if points >= chunk_points:
            state.add(pending)
            pending, points = [], 0
    if points:
        state.add(pending)
    return state.finish()


class _State:
    def __init__(
        self, origins: npt.NDArray[np.float64], grid: VoxelGrid, settings: Mapping[str, Any]
    ) -> None:
        self.origins, self.grid = origins, grid
        self.spacing = {True: settings["min_view_spacing_m"], False: settings["rear_view_spacing_m"]}
        # (views, baseline) after which a sensor's quota can no longer fail; the rear has no baseline.
        self.enough = {
            True: (settings["front_votes_max"], settings["baseline_far_m"]),
            False: (settings["rear_votes_max"], 0.0),
        }
        self.keys = np.empty(0, dtype=np.int64)
        self.columns: dict[str, npt.NDArray[Any]] = {
            "count": np.empty(0, dtype=np.int32),
            "first": np.empty(0, dtype=np.int32),
            "last": np.empty(0, dtype=np.int32),
            "sum": np.empty((0, 3), dtype=np.int64),
            "low": np.empty((0, 3), dtype=np.int64),
            "high": np.empty((0, 3), dtype=np.int64),
            "baseline": np.empty(0),
            "views_front": np.empty(0, dtype=np.int32),
            "views_rear": np.empty(0, dtype=np.int32),
            "settled_front": np.empty(0, dtype=np.bool_),
            "settled_rear": np.empty(0, dtype=np.bool_),
        }
        # (voxel, burst) pairs of the viewpoints accepted so far in voxels that are not settled.
        empty = np.empty(0, dtype=np.int64)
        self.pairs = {True: (empty, empty), False: (empty, empty)}

    def add(self, bursts: list[tuple[int, bool, npt.NDArray[np.float64]]]) -> None:
        points = np.concatenate([p for _, _, p in bursts])
        burst = np.repeat([b for b, _, _ in bursts], [len(p) for _, _, p in bursts])
        front = np.repeat([f for _, f, _ in bursts], [len(p) for _, _, p in bursts])
        keys = self.grid.keys(points)
        order = np.argsort(keys, kind="stable")
        keys, burst, front = keys[order], burst[order], front[order]
        offsets = self.grid.steps(points[order])
        starts = np.flatnonzero(np.r_[True, keys[1:] != keys[:-1]])
        self._grow(keys[starts])
        slots = np.searchsorted(self.keys, keys[starts])
        c = self.columns
        c["count"][slots] += np.diff(np.r_[starts, len(keys)]).astype(np.int32)
        c["sum"][slots] += np.add.reduceat(offsets, starts)
        c["low"][slots] = np.minimum(c["low"][slots], np.minimum.reduceat(offsets, starts))
        c["high"][slots] = np.maximum(c["high"][slots], np.maximum.reduceat(offsets, starts))
        c["first"][slots] = np.minimum(c["first"][slots], np.minimum.reduceat(burst, starts))
        c["last"][slots] = np.maximum(c["last"][slots], np.maximum.reduceat(burst, starts))
        slot_of_point = np.repeat(slots, np.diff(np.r_[starts, len(keys)]))
        first_of_burst = np.r_[True, (keys[1:] != keys[:-1]) | (burst[1:] != burst[:-1])]
        for is_front in (True, False):
            new = first_of_burst & (front == is_front)
            self._vote(is_front, slot_of_point[new], burst[new])

    def _grow(self, keys: npt.NDArray[np.int64]) -> None:
        merged = np.union1d(self.keys, keys)
        old = np.searchsorted(merged, self.keys)
        fills = {"low": OFFSET_STEPS, "high": -1, "first": np.iinfo(np.int32).max, "last": -1}
        for name, column in self.columns.items():
            grown = np.full((len(merged), *column.shape[1:]), fills.get(name, 0), dtype=column.dtype)
            grown[old] = column
            self.columns[name] = grown
        self.pairs = {sensor: (old[slot], burst) for sensor, (slot, burst) in self.pairs.items()}
        self.keys = merged

    def _vote(self, front: bool, slot: npt.NDArray[np.int64], burst: npt.NDArray[np.int64]) -> None:
        name = "front" if front else "rear"
        c = self.columns
        wanted = ~c[f"settled_{name}"][slot]
        slot, burst = slot[wanted], burst[wanted]
        touched = np.zeros(len(self.keys), dtype=np.bool_)
        touched[slot] = True
        old_slot, old_burst = self.pairs[front]
        again = touched[old_slot]
        slot = np.concatenate([old_slot[again], slot])
        burst = np.concatenate([old_burst[again], burst])
        order = np.lexsort((burst, slot))
        voxels, local = np.unique(slot[order], return_inverse=True)
        # Run again over what was accepted before, then what is new: the greedy outcome is the same.
        enough, far = self.enough[front]
        views = distinct_views(
            local, burst[order], self.origins, len(voxels), self.spacing[front], enough, far
        )
        c[f"views_{name}"][voxels] = views.count
        c[f"settled_{name}"][voxels] = views.settled
        if front:
            c["baseline"][voxels] = views.baseline
        self.pairs[front] = (
            np.concatenate([old_slot[~again], voxels[views.voxel]]),
            np.concatenate([old_burst[~again], views.burst]),
        )

    def finish(self) -> VoxelMap:
        c = self.columns
        return VoxelMap(
            grid=self.grid,
            keys=self.keys,
            counts=c["count"],
            centroids=centroids(c["sum"], c["count"], self.grid.size),
            extents=extents(c["high"] - c["low"], self.grid.size),
            front_views=c["views_front"],
            rear_views=c["views_rear"],
            baseline=c["baseline"],
            first=c["first"],
            span=np.minimum(c["last"] - c["first"], MAX_SPAN).astype(np.uint16),
        )
