"""What the rays of one sweep say of the voxels they hit or pass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.block_grid import BlockGrid
from card.ground_truth.compiled import compiled

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Ints = npt.NDArray[np.int32]

#: A ray crosses a voxel if it comes this far inside, in voxels: so that no rounding in the walk can lose a
#: voxel that counts.
FACE = 1e-6
#: What the walk takes more at both ends, in voxels: the nearest point to a centroid may lie beside the voxel.
_MORE = 2.0
#: What the walk goes beyond a face to be in the next voxel, in voxels.
_STEP = 1e-7
FLAT = 1e-10
#: Columns of the votes.
HIT, BESIDE, MOVED, ELSEWHEN, MOVED_ELSEWHEN = 0, 1, 2, 3, 4
#: What is known of a voxel in one sweep.
_FREE, _DONE, _UNKNOWN = 1, 2, 0


class PassRule(NamedTuple):
    """Settings of the same names, metres."""

    nearest_m: float
    furthest_m: float
    lateral_m: float
    beyond_m: float
    near_voxels: int
    gap_m: float
    residual_m: float
    incidence: float


class Region(NamedTuple):
    """The V voxels round the sweeps at hand.

    world : (3,) grid index, in world, of the block grid's cell (0, 0, 0). offsets: (V, 3) of the centroids.
    chosen : (V,) number of the voxel among those that votes are wanted of, -1 for others.
    normals, planar : (V, 3), (V,) the surface there: 1 planar, 0 not.
    begin, end : (V,) ns, from when to when the voxel counts as hit.
    returns : (B, 8) scratch: cells with a return of the sweep, all zero between sweeps.
    known : (V,) scratch: 3 x sweep + what is known.
    """

    grid: BlockGrid
    world: Index
    offsets: npt.NDArray[np.float32]
    chosen: Index
    normals: npt.NDArray[np.float32]
    planar: npt.NDArray[np.int8]
    begin: Index
    end: Index
    returns: npt.NDArray[np.uint64]
    known: Index


@compiled
def sweep_votes(
    sweep: int,
    t_ns: int,
    points: Floats,
    origins: Floats,
    size: float,
    region: Region,
    rule: PassRule,
    votes: Ints,
) -> None:
    """Add the votes of one sweep at a time, at most one a voxel, to `votes` (C, 5)."""
    touched = _enter_returns(sweep, points, origins, size, region, rule, votes)
    for i in range(len(points)):
        _walk(sweep, t_ns, points[i], origins[i], size, region, rule, votes)
    for b in touched:
        region.returns[b] = 0


@compiled
def _cell(point: Floats, size: float, world: Index) -> tuple[int, int, int]:
    return (
        np.int64(np.floor(point[0] / size)) - world[0],
        np.int64(np.floor(point[1] / size)) - world[1],
        np.int64(np.floor(point[2] / size)) - world[2],
    )


@compiled
def _enter_returns(
    sweep: int, points: Floats, origins: Floats, size: float, region: Region, rule: PassRule, votes: Ints
) -> list[int]:
    """Mark the cells with returns and count the hits; the blocks touched."""
    shape = region.grid.block.shape
    touched = [0 for _ in range(0)]
    for i in range(len(points)):
        x, y, z = _cell(points[i], size, region.world)
        if not (0 <= x < shape[0] << 3 and 0 <= y < shape[1] << 3 and 0 <= z < shape[2] << 3):
            continue
        b = region.grid.block[x >> 3, y >> 3, z >> 3]
        if b < 0:
            continue
        bits = region.returns[b]
        if not bits.any():
            touched.append(b)
        bits[x & 7] |= np.uint64(1) << np.uint64((y & 7) << 3 | z & 7)
        length, _, _, _ = _direction(points[i], origins[i])
        if length <= rule.furthest_m:
            v = region.grid.number[b, x & 7, (y & 7) << 3 | z & 7]
            if v < 0:
                continue
            if region.known[v] != 3 * sweep + _DONE:
                region.known[v] = 3 * sweep + _DONE
                if region.chosen[v] >= 0:
                    votes[region.chosen[v], HIT] += 1
    return touched


@compiled
def _direction(point: Floats, origin: Floats) -> tuple[float, float, float, float]:
    """Length and unit vector of a ray."""
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    length = np.sqrt(x * x + y * y + z * z)
    return length, x / length, y / length, z / length


@compiled
def _steady(d: float) -> tuple[float, float]:
    """d and 1 / d for the walk: a ray within 1e-7 voxels of its start along an axis meets no face there."""
    if abs(d) > FLAT:
        return d, 1 / d
    return 0.0, 1e30


@compiled
def _walk(
    sweep: int,
    t_ns: int,
    point: Floats,
    origin: Floats,
    size: float,
    region: Region,
    rule: PassRule,
    votes: Ints,
) -> None:
    """Look at every voxel that a ray crosses, block by block, within the part of a block that is occupied."""
    grid, shape = region.grid, region.grid.block.shape
    length, ux, uy, uz = _direction(point, origin)
    end = min(length - rule.beyond_m, rule.furthest_m) / size + _MORE
    t = max(rule.nearest_m / size - _MORE, 0.0)
    ox = origin[0] / size - region.world[0]
    oy = origin[1] / size - region.world[1]
    oz = origin[2] / size - region.world[2]
    dx, sx = _steady(ux)
    dy, sy = _steady(uy)
    dz, sz = _steady(uz)
    # Whether the face through which the ray leaves is the upper one.
    fx, fy, fz = int(sx > 0), int(sy > 0), int(sz > 0)
    while t <= end:
        x = np.int64(np.floor(ox + t * dx)) >> 3
        y = np.int64(np.floor(oy + t * dy)) >> 3
        z = np.int64(np.floor(oz + t * dz)) >> 3
        if not (0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]):
            return
        leave = min(((x + fx) * 8 - ox) * sx, ((y + fy) * 8 - oy) * sy, ((z + fz) * 8 - oz) * sz)
        b = grid.block[x, y, z]
        if b >= 0:
            box = grid.bounds[b]
            lx, hx = ((x << 3) + box[0] - ox) * sx, ((x << 3) + box[3] + 1 - ox) * sx
            ly, hy = ((y << 3) + box[1] - oy) * sy, ((y << 3) + box[4] + 1 - oy) * sy
            lz, hz = ((z << 3) + box[2] - oz) * sz, ((z << 3) + box[5] + 1 - oz) * sz
            s = max(t, max(min(lx, hx), min(ly, hy), min(lz, hz)) - _STEP)
            last = min(leave, end, min(max(lx, hx), max(ly, hy), max(lz, hz))) + _STEP
            while s <= last:
                i, j, k = int(ox + s * dx), int(oy + s * dy), int(oz + s * dz)
                if i >> 3 == x and j >> 3 == y and k >> 3 == z:
                    bit = (j & 7) << 3 | k & 7
                    if (grid.bits[b, i & 7] >> np.uint64(bit)) & np.uint64(1) != 0:
                        v = grid.number[b, i & 7, bit]
                        if region.chosen[v] >= 0 and region.known[v] != 3 * sweep + _DONE:
                            ray, unit = (point, origin), (ux, uy, uz)
                            _look(sweep, t_ns, v, (i, j, k), ray, length, unit, size, region, rule, votes)
                s = max(min((i + fx - ox) * sx, (j + fy - oy) * sy, (k + fz - oz) * sz), s) + _STEP
        t = max(leave, t) + _STEP


@compiled
def _look(
    sweep: int,
    t_ns: int,
    v: int,
    cell: tuple[int, int, int],
    ray: tuple[Floats, Floats],
    length: float,
    unit: tuple[float, float, float],
    size: float,
    region: Region,
    rule: PassRule,
    votes: Ints,
) -> None:
    """What a ray that crosses voxel v says of it."""
    x, y, z = cell
    point, origin = ray
    dx, dy, dz = unit
    wx, wy, wz = x + region.world[0], y + region.world[1], z + region.world[2]
    offset = region.offsets[v]
    cx, cy, cz = wx * size + offset[0], wy * size + offset[1], wz * size + offset[2]
    ax, ay, az = cx - origin[0], cy - origin[1], cz - origin[2]
    along = ax * dx + ay * dy + az * dz
    if along < rule.nearest_m or along > rule.furthest_m or length - along < rule.beyond_m:
        return
    if ax * ax + ay * ay + az * az - along * along > rule.lateral_m * rule.lateral_m:
        return
    lx, hx = _span(wx - origin[0] / size, dx)
    ly, hy = _span(wy - origin[1] / size, dy)
    lz, hz = _span(wz - origin[2] / size, dz)
    if max(lx, ly, lz) > min(hx, hy, hz):
        return
    c = region.chosen[v]
    if region.known[v] != 3 * sweep + _FREE:
        if _has_return_near(region, x, y, z, rule.near_voxels):
            votes[c, BESIDE] += 1
            votes[c, ELSEWHEN] += t_ns < region.begin[v] or t_ns > region.end[v]
            region.known[v] = 3 * sweep + _DONE
            return
        region.known[v] = 3 * sweep + _FREE
    if length - along < rule.gap_m:
        return
    if region.planar[v] == 1:
        nx, ny, nz = region.normals[v]
        off = nx * (point[0] - cx) + ny * (point[1] - cy) + nz * (point[2] - cz)
        if abs(off) <= rule.residual_m or abs(nx * dx + ny * dy + nz * dz) <= rule.incidence:
            return
    votes[c, MOVED] += 1
    if t_ns < region.begin[v] or t_ns > region.end[v]:
        votes[c, ELSEWHEN] += 1
        votes[c, MOVED_ELSEWHEN] += 1
    region.known[v] = 3 * sweep + _DONE


@compiled
def _span(low: float, d: float) -> tuple[float, float]:
    """Where along a ray it is between two faces of a voxel; low: of the lower one from the origin, voxels."""
    _, slope = _steady(d)
    one, other = (low + FACE) * slope, (low + (1 - FACE)) * slope
    return min(one, other), max(one, other)


@compiled
def _has_return_near(region: Region, x: int, y: int, z: int, radius: int) -> bool:
    """Whether the sweep has a return in the cube of 2 radius + 1 voxels round a cell."""
    for i in range(x - radius, x + radius + 1):
        for j in range(y - radius, y + radius + 1):
            for k in range((z - radius) >> 3, ((z + radius) >> 3) + 1):
                b = region.grid.block[i >> 3, j >> 3, k]
                if b < 0:
                    continue
                low, high = max(z - radius - (k << 3), 0), min(z + radius - (k << 3), 7)
                wanted = np.uint64(((1 << (high - low + 1)) - 1) << low)
                if (region.returns[b, i & 7] >> np.uint64((j & 7) << 3)) & wanted != 0:
                    return True
    return False
