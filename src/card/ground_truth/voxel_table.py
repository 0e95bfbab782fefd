"""A hash table of voxels that takes a burst at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled
from card.ground_truth.voxels import AXIS_BITS, OFFSET_STEPS

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Ints = npt.NDArray[np.int32]
Voxels = npt.NDArray[np.void]

#: One voxel in one line of the processor's cache. sum_*: of offsets in steps, the low 32 bits of each and the
#: bits above. front, rear: the first burst of each LiDAR, -1 for none. more: its further front views.
#: span: bursts from the first hit to the last, at most MAX_SPAN.
VOXEL = np.dtype(
    [
        ("key", "i8"),
        ("baseline", "f8"),
        ("count", "i4"),
        ("front", "i4"),
        ("rear", "i4"),
        ("more", "i4"),
        *[(f"sum_{a}", "u4") for a in "xyz"],
        *[(f"low_{a}", "u2") for a in "xyz"],
        *[(f"high_{a}", "u2") for a in "xyz"],
        ("front_views", "u2"),
        ("span", "u2"),
        ("rear_views", "u1"),
        *[(f"over_{a}", "u1") for a in "xyz"],
    ],
    align=True,
)
assert VOXEL.itemsize == 64, VOXEL.itemsize
#: A voxel hit for longer, in bursts, has a span of this: with two LiDARs at 10 Hz nearly an hour.
MAX_SPAN = 65535
_HASH = np.uint64(0x9E3779B97F4A7C15)


@compiled
def add_burst(
    points: Floats,
    burst: int,
    front: bool,
    origins: Floats,
    size: float,
    first: Index,
    front_spacing: float,
    rear_spacing: float,
    enough_front: int,
    enough_rear: int,
    far: float,
    voxels: Voxels,
    views: Ints,
    slots: Ints,
    used: Index,
) -> int:
    """Add the points (N, 3) of one burst; the position of a point outside the grid, or -1.

    voxels, views and slots must have room for N more; a view is (burst, next view of the voxel).
    used: (2,) voxels and views in use.
    """
    limit = 1 << AXIS_BITS
    for i in range(len(points)):
        x, y, z = points[i, 0] / size, points[i, 1] / size, points[i, 2] / size
        fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
        ix, iy, iz = np.int64(fx) - first[0], np.int64(fy) - first[1], np.int64(fz) - first[2]
        if not (0 <= ix < limit and 0 <= iy < limit and 0 <= iz < limit):
            return i
        key = (ix << 2 * AXIS_BITS) | (iy << AXIS_BITS) | iz
        slot = _slot(key, voxels, slots)
        at = slots[slot]
        qx = np.int64((x - fx) * OFFSET_STEPS)
        qy = np.int64((y - fy) * OFFSET_STEPS)
        qz = np.int64((z - fz) * OFFSET_STEPS)
        if at < 0:
            at = used[0]
            used[0] += 1
            slots[slot] = at
            v = voxels[at]
            v.key, v.front, v.rear, v.more = key, -1, -1, -1
            v.low_x, v.low_y, v.low_z = qx, qy, qz
            v.high_x, v.high_y, v.high_z = qx, qy, qz
        v = voxels[at]
        v.count += 1
        sx, sy, sz = np.int64(v.sum_x) + qx, np.int64(v.sum_y) + qy, np.int64(v.sum_z) + qz
        v.sum_x, v.sum_y, v.sum_z = sx, sy, sz
        v.over_x += sx >> 32
        v.over_y += sy >> 32
        v.over_z += sz >> 32
        v.low_x, v.low_y, v.low_z = min(v.low_x, qx), min(v.low_y, qy), min(v.low_z, qz)
        v.high_x, v.high_y, v.high_z = max(v.high_x, qx), max(v.high_y, qy), max(v.high_z, qz)
        if front:
            if v.front_views < enough_front or v.baseline < far:
                _see(v, burst, True, origins, front_spacing, views, used)
        elif v.rear_views < enough_rear:
            _see(v, burst, False, origins, rear_spacing, views, used)
        earliest = max(v.front, v.rear) if min(v.front, v.rear) < 0 else min(v.front, v.rear)
        v.span = min(burst - earliest, MAX_SPAN)
    return -1


@compiled
def _see(v: Any, burst: int, front: bool, origins: Floats, spacing: float, views: Ints, used: Index) -> None:
    """Accept a viewpoint of a LiDAR that is far enough from all before it; front views span a baseline."""
    earliest = v.front if front else v.rear
    if earliest < 0:
        if front:
            v.front, v.front_views = burst, 1
        else:
            v.rear, v.rear_views = burst, 1
        return
    widest = _apart(origins, burst, earliest)
    if earliest == burst or widest < spacing:
        return
    at = v.more
    while at >= 0:
        # Rear views are kept as -1 - burst.
        other = views[at, 0] if front else -1 - views[at, 0]
        if other >= 0:
            apart = _apart(origins, burst, other)
            if other == burst or apart < spacing:
                return
            widest = max(widest, apart)
        at = views[at, 1]
    views[used[1], 0] = burst if front else -1 - burst
    views[used[1], 1] = v.more
    v.more = used[1]
    used[1] += 1
    if front:
        v.front_views += 1
        v.baseline = max(v.baseline, widest)
    else:
        v.rear_views += 1


@compiled
def _apart(origins: Floats, a: int, b: int) -> Any:
    x, y, z = origins[a, 0] - origins[b, 0], origins[a, 1] - origins[b, 1], origins[a, 2] - origins[b, 2]
    return np.sqrt(x * x + y * y + z * z)


@compiled
def _slot(key: int, voxels: Voxels, slots: Ints) -> Any:
    """Where `key` is, or belongs, in a table whose length is a power of two."""
    mask = len(slots) - 1
    slot = np.int64((np.uint64(key) * _HASH) >> np.uint64(32)) & mask
    while slots[slot] >= 0 and voxels[slots[slot]].key != key:
        slot = (slot + 1) & mask
    return slot


@compiled
def index(voxels: Voxels, count: int, slots: Ints) -> None:
    """Enter the first `count` voxels into an empty table."""
    for at in range(count):
        slots[_slot(voxels[at].key, voxels, slots)] = at


@compiled
def permute(voxels: Voxels, order: Index) -> None:
    """voxels[:] = voxels[order] without a second copy; `order` (V,) is used up."""
    for start in range(len(order)):
        if order[start] < 0:
            continue
        held = voxels[start : start + 1].copy()
        to = start
        while order[to] != start:
            voxels[to] = voxels[order[to]]
            step = order[to]
            order[to] = -1
            to = step
        voxels[to] = held[0]
        order[to] = -1


def sums(voxels: Voxels) -> Index:
    """(V, 3) sums of offsets, in steps."""
    parts = [voxels[f"sum_{a}"] + (voxels[f"over_{a}"].astype(np.int64) << 32) for a in "xyz"]
    return np.stack(parts, axis=1)


def first_bursts(voxels: Voxels) -> Ints:
    """(V,) the first burst of either LiDAR."""
    front, rear = voxels["front"], voxels["rear"]
    earliest: Ints = np.where(np.minimum(front, rear) < 0, np.maximum(front, rear), np.minimum(front, rear))
    return earliest
