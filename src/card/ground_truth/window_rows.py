"""The points of a `StaticWindow` by voxel and LiDAR, and the span of them that is in the windows; compiled.

The points of voxel v that LiDAR s (0 front, 1 rear) measured lie in row 2 v + s: side by side and in order
of time. Those in the windows are a run of the row, from its head to its tail. A burst that enters moves the
tails of the rows it hits, one that leaves moves their heads; nothing else moves as frames go by.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled


class Rows(NamedTuple):
    """P points in rows of V voxels.

    start: (2 V + 1,) int64. head, tail: (2 V,) int64, ends of the run in the windows.
    offset: (P, 3) float32, metres from the voxel's corner. burst: (P,) int32 ordinals.
    kept: (P,) bool, what cleaning leaves. changed: (V,) bool, cleaning is out of date.
    clean, left: (V,) int64 inliers, and how many of them are kept. corner: (V, 3) float64 world, metres.
    mean: (V, 3) float64 of the inliers, metres from the corner. spread: (V, 6) float64, their covariance,
    xx xy xz yy yz zz, square metres.
    """

    start: npt.NDArray[np.int64]
    head: npt.NDArray[np.int64]
    tail: npt.NDArray[np.int64]
    offset: npt.NDArray[np.float32]
    burst: npt.NDArray[np.int32]
    kept: npt.NDArray[np.bool_]
    changed: npt.NDArray[np.bool_]
    clean: npt.NDArray[np.int64]
    left: npt.NDArray[np.int64]
    corner: npt.NDArray[np.float64]
    mean: npt.NDArray[np.float64]
    spread: npt.NDArray[np.float64]


@compiled
def number(voxel: Any, local: Any, found: Any, count: int) -> int:
    """Give each voxel not met before the next number in `local`, -1 so far, and list it in `found`."""
    for v in voxel:
        if local[v] < 0:
            local[v] = count
            found[count] = v
            count += 1
    return count


@compiled
def measure(voxel: Any, local: Any, sensor: int, size: Any) -> None:
    """Add the points of a burst to the sizes (2 V,) of their rows."""
    for v in voxel:
        size[2 * local[v] + sensor] += 1


@compiled
def fill(voxel: Any, offset: Any, local: Any, sensor: int, ordinal: int, end: Any, rows: Rows) -> None:
    """Append the points of a burst to their rows, which so far end at `end` (2 V,)."""
    for i in range(voxel.size):
        row = 2 * local[voxel[i]] + sensor
        at = end[row]
        end[row] = at + 1
        rows.burst[at] = ordinal
        for k in range(3):
            rows.offset[at, k] = offset[i, k]


@compiled
def move(voxel: Any, local: Any, sensor: int, ends: Any, changed: Any) -> None:
    """Move the heads or the tails (2 V,) past the points of a burst."""
    for v in voxel:
        ends[2 * local[v] + sensor] += 1
        changed[local[v]] = True
