"""The plane through the voxels round one (`reference.surface` is the same in plain numpy)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.block_grid import BlockGrid
from card.ground_truth.compiled import compiled

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Offsets = npt.NDArray[np.float32]

#: Sweeps of rotations after which a 3 x 3 matrix is diagonal to the last bit; four are enough.
_SWEEPS = 8


class PlaneRule(NamedTuple):
    """When a voxel is planar; see `find_planes`."""

    near_voxels: int
    min_voxels: int
    max_thickness_m: float
    min_ratio: float


@compiled
def find_planes(
    grid: BlockGrid,
    cells: Index,
    offsets: Offsets,
    size: float,
    wanted: npt.NDArray[np.bool_],
    rule: PlaneRule,
    normals: Offsets,
    planar: npt.NDArray[np.int8],
) -> None:
    """Write the normals (V, 3) of the wanted voxels (V,) and whether they are planar (V,), 0 or 1.

    The plane goes through the means of the voxels in the cube of 2 `near_voxels` + 1 round one, each of the
    same weight. With the standard deviations s0 <= s1 <= s2 along the principal axes, the voxel is planar if
    the cube holds `min_voxels` or more, s0 < `max_thickness_m` and s1 > `min_ratio` s0.

    Parameters
    ----------
    cells : (V, 3) of the voxels in the grid. offsets : (V, 3) of their means from their corners, metres.
    """
    normal = np.zeros(3)
    for v in range(len(cells)):
        if wanted[v]:
            cell = cells[v, 0], cells[v, 1], cells[v, 2]
            planar[v] = _plane(grid, offsets, size, cell, rule, normal)
            for a in range(3):
                normals[v, a] = normal[a]


@compiled
def _plane(
    grid: BlockGrid,
    offsets: Offsets,
    size: float,
    cell: tuple[int, int, int],
    rule: PlaneRule,
    normal: Floats,
) -> bool:
    count, a = _scatter(grid, offsets, size, cell, rule.near_voxels)
    if count < rule.min_voxels:
        return False
    v = np.eye(3)
    for _ in range(_SWEEPS):
        if a[0, 1] == 0 and a[0, 2] == 0 and a[1, 2] == 0:
            break
        _rotate(a, v, 0, 1)
        _rotate(a, v, 0, 2)
        _rotate(a, v, 1, 2)
    k = 0
    for i in (1, 2):
        if a[i, i] < a[k, k]:
            k = i
    i, j = (k + 1) % 3, (k + 2) % 3
    thin = np.sqrt(max(a[k, k], 0.0))
    middle = np.sqrt(max(min(a[i, i], a[j, j]), 0.0))
    for row in range(3):
        normal[row] = v[row, k]
    return thin < rule.max_thickness_m and middle > rule.min_ratio * thin


@compiled
def _scatter(
    grid: BlockGrid, offsets: Offsets, size: float, cell: tuple[int, int, int], radius: int
) -> tuple[int, Floats]:
    """Count and scatter (3, 3) of the means round a cell, from its own corner."""
    count, mean, second = 0, np.zeros(3), np.zeros((3, 3))
    p = np.empty(3)
    for x in range(cell[0] - radius, cell[0] + radius + 1):
        for y in range(cell[1] - radius, cell[1] + radius + 1):
            for z in range(cell[2] - radius, cell[2] + radius + 1):
                b = grid.block[x >> 3, y >> 3, z >> 3]
                if b < 0:
                    continue
                v = grid.number[b, x & 7, (y & 7) << 3 | z & 7]
                if v < 0:
                    continue
                offset = offsets[v]
                p[0] = offset[0] + (x - cell[0]) * size
                p[1] = offset[1] + (y - cell[1]) * size
                p[2] = offset[2] + (z - cell[2]) * size
                count += 1
                for i in range(3):
                    mean[i] += p[i]
                    for j in range(i, 3):
                        second[i, j] += p[i] * p[j]
    for i in range(3):
        mean[i] /= count
    for i in range(3):
        for j in range(i, 3):
            second[i, j] = second[i, j] / count - mean[i] * mean[j]
            second[j, i] = second[i, j]
    return count, second


@compiled
def _rotate(a: Floats, v: Floats, p: int, q: int) -> None:
    """One Jacobi rotation: zero the entry (p, q) of a symmetric matrix; v collects the eigenvectors."""
    if a[p, q] == 0:
        return
    theta = (a[q, q] - a[p, p]) / (2 * a[p, q])
    t = 1 / (abs(theta) + np.sqrt(theta * theta + 1))
    if theta < 0:
        t = -t
    c = 1 / np.sqrt(t * t + 1)
    s = t * c
    r = 3 - p - q
    a_pq = a[p, q]
    a[p, p] -= t * a_pq
    a[q, q] += t * a_pq
    a[p, q] = a[q, p] = 0.0
    a_rp, a_rq = a[r, p], a[r, q]
    a[r, p] = a[p, r] = c * a_rp - s * a_rq
    a[r, q] = a[q, r] = s * a_rp + c * a_rq
    for i in range(3):
        v_ip, v_iq = v[i, p], v[i, q]
        v[i, p] = c * v_ip - s * v_iq
        v[i, q] = s * v_ip + c * v_iq
