"""What is kept of every voxel while the bursts of a drive stream by (paper, supplement A and B)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth import voxel_table as table
from card.ground_truth.voxels import OFFSET_STEPS, VoxelGrid, outside

#: Voxels whose columns are made at once when a map is finished.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class VoxelMap:
    """All voxels of a drive, sorted by key.

    counts: (V,) int32 points. centroids: (V, 3) float32, metres from the voxel's lower corner.
    extents: (V,) float32, diagonal of the bounding box of the points, metres. Both come from offsets in
    whole 4096ths of a voxel, so that they do not depend on the order of the points.
    front_views, rear_views: (V,) int32 distinct views; counting ends once no quota can fail any more.
    baseline: (V,) float64, metres, of the front views counted.
    first: (V,) int32 ordinal of the first burst with a point; span: (V,) uint16 bursts from it to the last,
    at most `voxel_table.MAX_SPAN`.
    """

    grid: VoxelGrid
    keys: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int32]
    centroids: npt.NDArray[np.float32]
    extents: npt.NDArray[np.float32]
    front_views: npt.NDArray[np.int32]
    rear_views: npt.NDArray[np.int32]
    baseline: npt.NDArray[np.float64]
    first: npt.NDArray[np.int32]
    span: npt.NDArray[np.uint16]

    @property
    def hit_by_both(self) -> npt.NDArray[np.bool_]:
        """(V,) voxels that both LiDARs hit at some time of the drive."""
        return (self.front_views > 0) & (self.rear_views > 0)


def build_voxel_map(
    bursts: Iterable[tuple[int, bool, npt.NDArray[np.float64]]],
    origins: npt.NDArray[np.float64],
    grid: VoxelGrid,
    settings: Mapping[str, Any],
) -> VoxelMap:
    """The map of a drive's bursts, given in the fixed order (end time, sensor, index).

    `reference.voxel_map` is the same in plain numpy. Memory: 64 bytes a voxel, and what its views take.

    Parameters
    ----------
    bursts : ordinal (increasing), whether it is the front LiDAR's, world points (N, 3) metres.
    origins : (B, 3) sensor origin of each ordinal in world, metres.

    Raises
    ------
    CardError
        If a point lies outside the grid.
    """
    state = _State(grid, settings)
    for burst, front, points in bursts:
        state.add(burst, front, points, origins)
    return state.finish()


class _State:
    """Voxels in the order in which they were first hit; see `voxel_table`."""

    def __init__(self, grid: VoxelGrid, settings: Mapping[str, Any]) -> None:
        self._grid = grid
        self._first = np.array(grid.first, dtype=np.int64)
        self._gate = (
            float(settings["min_view_spacing_m"]),
            float(settings["rear_view_spacing_m"]),
            int(settings["front_votes_max"]),
            int(settings["rear_votes_max"]),
            float(settings["baseline_far_m"]),
        )
        self._voxels = np.zeros(1 << 16, dtype=table.VOXEL)
        self._views = np.zeros((1 << 14, 2), dtype=np.int32)
        self._slots = np.full(1 << 17, -1, dtype=np.int32)
        # Voxels and views in use.
        self._used = np.zeros(2, dtype=np.int64)

    def add(
        self, burst: int, front: bool, points: npt.NDArray[np.float64], origins: npt.NDArray[np.float64]
    ) -> None:
        self._make_room(len(points))
        bad = table.add_burst(
            points, burst, front, origins, self._grid.size, self._first, *self._gate,
            self._voxels, self._views, self._slots, self._used,
        )  # fmt: skip
        if bad >= 0:
            raise outside(points[bad])

    def _make_room(self, points: int) -> None:
        voxels, views = int(self._used[0]) + points, int(self._used[1]) + points
        # Growing in place moves pages, not bytes.
        if voxels > len(self._voxels):
            self._voxels.resize(voxels + voxels // 4, refcheck=False)
        if views > len(self._views):
            self._views.resize((views + views // 4, 2), refcheck=False)
        if voxels > 0.65 * len(self._slots):
            self._slots = np.full(len(self._slots) * 2, -1, dtype=np.int32)
            table.index(self._voxels, int(self._used[0]), self._slots)

    def finish(self) -> VoxelMap:
        count = int(self._used[0])
        self._slots = np.empty(0, dtype=np.int32)
        self._views = np.empty((0, 2), dtype=np.int32)
        voxels = self._voxels
        voxels.resize(count, refcheck=False)
        table.permute(voxels, np.argsort(voxels["key"]))
        out = VoxelMap(
            grid=self._grid,
            keys=np.empty(count, dtype=np.int64),
            counts=np.empty(count, dtype=np.int32),
            centroids=np.empty((count, 3), dtype=np.float32),
            extents=np.empty(count, dtype=np.float32),
            front_views=np.empty(count, dtype=np.int32),
            rear_views=np.empty(count, dtype=np.int32),
            baseline=np.empty(count, dtype=np.float64),
            first=np.empty(count, dtype=np.int32),
            span=np.empty(count, dtype=np.uint16),
        )
        # From the end, giving back what is done: the columns and the records never exist together.
        for start in range((count - 1) // _CHUNK * _CHUNK, -1, -_CHUNK):
            part, to = voxels[start:], slice(start, start + _CHUNK)
            out.keys[to] = part["key"]
            out.counts[to] = part["count"]
            sums = table.sums(part)
            out.centroids[to] = centroids(sums, part["count"], self._grid.size)
            spans = np.stack([part[f"high_{a}"].astype(np.int64) - part[f"low_{a}"] for a in "xyz"], axis=1)
            out.extents[to] = extents(spans, self._grid.size)
            out.front_views[to] = part["front_views"]
            out.rear_views[to] = part["rear_views"]
            out.baseline[to] = part["baseline"]
            out.first[to] = table.first_bursts(part)
            out.span[to] = part["span"]
            del part
            voxels.resize(start, refcheck=False)
        return out


def centroids(
    sums: npt.NDArray[np.int64], counts: npt.NDArray[np.int32], size: float
) -> npt.NDArray[np.float32]:
    """Metres (V, 3) from the lower corner, of sums (V, 3) of offsets; a step stands for its middle."""
    return ((sums / counts[:, None] + 0.5) * (size / OFFSET_STEPS)).astype(np.float32)


def extents(spans: npt.NDArray[np.int64], size: float) -> npt.NDArray[np.float32]:
    """Metres (V,): diagonals of boxes of spans (V, 3) in steps."""
    return (np.sqrt((spans**2).sum(axis=1)) * (size / OFFSET_STEPS)).astype(np.float32)
