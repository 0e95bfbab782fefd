"""The lower convex hull of lifted points as an incremental regular triangulation.

A point is located by walking from triangle to triangle. If it lies below the plane of the triangle that holds
it, all triangles it sees from below (they are connected) are replaced by a fan round it; if not, it is no
vertex of the hull. Joe, "Construction of three-dimensional Delaunay triangulations using local
transformations", CAGD 1991; Edelsbrunner and Shah, "Incremental Topological Flipping Works for Regular
Triangulations", SoCG 1992. Four corners far outside and far above all points stand for infinity.

Triangle t has the corners corner[4 t + k], k = 0, 1, 2, counter-clockwise in (u, v), and the sides 4 t + k,
each opposite to its corner. across[side] is the same side as the triangle beyond has it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled
from card.ground_truth.hpr.cells import Cells
from card.ground_truth.hpr.workspace import Workspace

Indices = npt.NDArray[np.uint32]

#: Corners that stand for infinity, placed after the points: their distance in (u, v) in units of the largest
#: coordinate of a cell, and their height in units of that distance.
CORNERS = 4
_FAR, _HIGH = 8.0, 1e8
#: No side there; no triangle there; seen by no point.
_NONE = 0xFFFFFFFF
#: Steps of a walk after which all triangles are searched: among nearly degenerate ones it may go in circles.
MAX_STEPS = 20_000
#: Points closer together than this, metres, are one point; the first to come stays.
MERGE_M = 1e-8


class Mesh(NamedTuple):
    """Memory of the triangulation of M points.

    corner, across : (4 T,) the triangles. seen_by : (T,) the last point that saw each from below.
    free, cavity : (T,) triangles to use again, and those a point replaces. sides : (3 T,) still to cross.
    rim : (3, T) sides of the cavity, in order round it: from, to, and the side as the triangle beyond has it.
    """

    corner: Indices
    across: Indices
    seen_by: Indices
    free: Indices
    cavity: Indices
    sides: Indices
    rim: Indices

    @classmethod
    def of(cls, points: int, workspace: Workspace) -> Mesh:
        """Room for this many points."""
        size = 2 * points + 16
        shapes: list[int | tuple[int, int]] = [4 * size, 4 * size, size, size, size, 3 * size, (3, size)]
        return cls(*(workspace.take(n, s, np.uint32) for n, s in zip(cls._fields, shapes, strict=True)))


def add_corners(lifted: Any, cells: Cells) -> None:
    """Fill the last four rows of `lifted` (M + 4, 4), whose points lie in the cells."""
    u, v = cells.u0 + cells.columns * cells.size, cells.v0 + cells.rows * cells.size
    far = _FAR * max(1.0, abs(cells.u0), abs(u), abs(cells.v0), abs(v))
    lifted[-CORNERS:] = [
        (su * far, sv * far, _HIGH * far, 1.0) for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]


@compiled
def _cross(p: Any, i: int, a: int, b: int) -> float:
    """Twice the area of the triangle (i, a, b) in (u, v); positive if it is counter-clockwise."""
    return (p[a, 0] - p[i, 0]) * (p[b, 1] - p[i, 1]) - (p[a, 1] - p[i, 1]) * (p[b, 0] - p[i, 0])


@compiled
def _same_place(p: Any, i: int, j: int) -> bool:
    """Whether two lifted points are closer together than MERGE_M."""
    scale_i = p[i, 3] / np.sqrt(1 + p[i, 0] * p[i, 0] + p[i, 1] * p[i, 1])
    if abs(p[i, 0] - p[j, 0]) * scale_i > 2 * MERGE_M:
        return False
    scale_j = p[j, 3] / np.sqrt(1 + p[j, 0] * p[j, 0] + p[j, 1] * p[j, 1])
    x, y = p[i, 0] * scale_i - p[j, 0] * scale_j, p[i, 1] * scale_i - p[j, 1] * scale_j
    z = scale_i - scale_j
    return x * x + y * y + z * z <= MERGE_M * MERGE_M


@compiled
def _search(p: Any, i: int, corner: Any, triangles: int) -> int:
    """The triangle that holds point i, or comes closest to it, by looking at all of them."""
    best, found = -np.inf, 0
    for t in range(triangles):
        a, b, c = corner[4 * t], corner[4 * t + 1], corner[4 * t + 2]
        if a == _NONE:
            continue
        inside = min(_cross(p, i, b, c), min(_cross(p, i, c, a), _cross(p, i, a, b)))
        if inside > best:
            best, found = inside, t
        if inside >= 0:
            break
    return found


@compiled
def _locate(p: Any, i: int, start: int, corner: Any, across: Any, triangles: int, max_steps: int) -> int:
    """The triangle that holds point i: cross any side that the point lies beyond."""
    pu, pv = p[i, 0], p[i, 1]
    t: Any = start
    crossed: Any = _NONE
    for _ in range(max_steps):
        base = 4 * t
        a, b, c = corner[base], corner[base + 1], corner[base + 2]
        au, av = p[a, 0] - pu, p[a, 1] - pv
        bu, bv = p[b, 0] - pu, p[b, 1] - pv
        cu, cv = p[c, 0] - pu, p[c, 1] - pv
        if au * bv - av * bu < 0 and base + 2 != crossed:
            crossed = np.int64(across[base + 2])
        elif bu * cv - bv * cu < 0 and base != crossed:
            crossed = np.int64(across[base])
        elif cu * av - cv * au < 0 and base + 1 != crossed:
            crossed = np.int64(across[base + 1])
        else:
            return t
        if crossed == _NONE:
            return t
        t = crossed >> 2
    return _search(p, i, corner, triangles)


@compiled
def _open_cavity(p: Any, i: int, first: int, mesh: Mesh) -> tuple[int, int]:
    """Collect the triangles that point i sees from below, from `first` on, and the rim round them.

    Returns how many of each.
    """
    corner, across, seen_by, cavity, sides = mesh.corner, mesh.across, mesh.seen_by, mesh.cavity, mesh.sides
    rim_from, rim_to, rim_side = mesh.rim[0], mesh.rim[1], mesh.rim[2]
    pu, pv, pw = p[i, 0], p[i, 1], p[i, 2]
    seen_by[first] = i
    cavity[0] = first
    sides[0], sides[1], sides[2] = 4 * first + 2, 4 * first + 1, 4 * first
    waiting, inside, rim = 3, 1, 0
    while waiting > 0:
        waiting -= 1
        side = np.int64(sides[waiting])
        base, k = side & ~3, side & 3
        a, b = corner[base + (k + 1 if k < 2 else 0)], corner[base + (k - 1 if k > 0 else 2)]
        beyond = np.int64(across[side])
        if beyond != _NONE:
            if seen_by[beyond >> 2] == i:
                continue
            o = corner[beyond]
            au, av = p[a, 0] - pu, p[a, 1] - pv
            bu, bv = p[b, 0] - pu, p[b, 1] - pv
            ou, ov = p[o, 0] - pu, p[o, 1] - pv
            area = bu * av - bv * au
            below = (p[b, 2] - pw) * (au * ov - av * ou) - (p[a, 2] - pw) * (bu * ov - bv * ou)
            below += (p[o, 2] - pw) * area
            # A side in line with the point would make an empty triangle: the one beyond goes too.
            if below > 0 or area >= 0:
                base, k = beyond & ~3, beyond & 3
                seen_by[beyond >> 2] = i
                cavity[inside] = beyond >> 2
                inside += 1
                sides[waiting] = base + (k - 1 if k > 0 else 2)
                sides[waiting + 1] = base + (k + 1 if k < 2 else 0)
                waiting += 2
                continue
        rim_from[rim], rim_to[rim], rim_side[rim] = a, b, beyond
        rim += 1
    return inside, rim


@compiled
def _is_loop(i: int, rim: int, mesh: Mesh) -> bool:
    """Whether the rim is one closed loop with the cavity on one side of it only."""
    for r in range(rim):
        if mesh.rim[1, r - 1 if r > 0 else rim - 1] != mesh.rim[0, r]:
            return False
        if mesh.rim[2, r] != _NONE and mesh.seen_by[np.int64(mesh.rim[2, r]) >> 2] == i:
            return False
    return True


@compiled
def _fill(i: int, rim: int, mesh: Mesh) -> None:
    """Put a fan round point i into the rim, in place of the first triangles of the cavity list."""
    corner, across, cavity = mesh.corner, mesh.across, mesh.cavity
    previous = 4 * np.int64(cavity[rim - 1])
    for r in range(rim):
        base = 4 * np.int64(cavity[r])
        corner[base], corner[base + 1], corner[base + 2] = i, mesh.rim[0, r], mesh.rim[1, r]
        beyond = mesh.rim[2, r]
        across[base] = beyond
        if beyond != _NONE:
            across[beyond] = base
        across[base + 1] = 4 * np.int64(cavity[r + 1 if r + 1 < rim else 0]) + 2
        across[base + 2] = previous + 1
        previous = base


@compiled
def lower_hull(p: Any, sequence: Any, mesh: Mesh, vertex: Any, max_steps: int) -> bool:
    """Mark the vertices of the lower hull; False if rounding left it without a consistent triangulation.

    Parameters
    ----------
    p : (M + 4, 4) lifted points and the far corners. sequence : (M,) order of insertion.
    vertex : (M + 4,) bool, output.
    max_steps : of a walk, before all triangles are searched.
    """
    corner, across = mesh.corner, mesh.across
    points = sequence.size
    for k in range(3):
        corner[k], corner[4 + k] = points + k, points + (0 if k == 0 else k + 1)
        across[k] = across[4 + k] = _NONE
    across[1], across[6] = 6, 1
    mesh.seen_by[:] = _NONE
    triangles, freed = 2, 0
    t: Any = 0
    for q in range(points):
        i = np.int64(sequence[q])
        t = _locate(p, i, t, corner, across, triangles, max_steps)
        a, b, c = corner[4 * t], corner[4 * t + 1], corner[4 * t + 2]
        below = (
            _cross(p, i, b, c) * (p[a, 2] - p[i, 2])
            + _cross(p, i, c, a) * (p[b, 2] - p[i, 2])
            + _cross(p, i, a, b) * (p[c, 2] - p[i, 2])
        )
        if below <= 0 or _same_place(p, i, a) or _same_place(p, i, b) or _same_place(p, i, c):
            continue
        inside, rim = _open_cavity(p, i, t, mesh)
        if not _is_loop(i, rim, mesh):
            return False
        # The fan takes the triangles of the cavity, then freed ones, then new ones.
        for r in range(inside, rim):
            if freed > 0:
                freed -= 1
                mesh.cavity[r] = mesh.free[freed]
            else:
                mesh.cavity[r] = triangles
                triangles += 1
        for r in range(rim, inside):
            mesh.free[freed] = mesh.cavity[r]
            freed += 1
            corner[4 * np.int64(mesh.cavity[r])] = _NONE
        _fill(i, rim, mesh)
        t = np.int64(mesh.cavity[0])
    for t in range(triangles):
        if corner[4 * t] != _NONE:
            for k in range(3):
                vertex[corner[4 * t + k]] = True
    return True
