"""An upper bound of the lower hull at the corners of the cells.

The height of the lower hull is a convex function of (u, v), and at any place no point above which is a
convex combination of lifted points lies below it. So interpolating between real points, then between bounds
along straight lines, gives bounds that hold for certain.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled
from card.ground_truth.hpr.cells import LEVELS, Cells
from card.ground_truth.hpr.workspace import Workspace

#: Where nothing is known the bound is far above every point.
UNKNOWN = 1e30
_THINNEST = 1e-18  # twice the smallest area of a triangle that is interpolated in
_U, _V, _W, _N = 0, 1, 2, 3


def upper_bound(
    cells: Cells,
    occupied: npt.NDArray[np.int64],
    lifted: npt.NDArray[np.float64],
    workspace: Workspace,
) -> npt.NDArray[np.float64]:
    """The bound at the corners, (rows + 1, columns + 1); UNKNOWN where there is none.

    Parameters
    ----------
    occupied, lifted : cells (M,) with a point, and u, v, W, n (M, 4) of one in each.
    """
    columns, rows = cells.columns, cells.rows
    bound = workspace.take("bound", (rows + 1, columns + 1), np.float64)
    bound[:] = UNKNOWN
    level = workspace.take("level 0", (rows * columns, 4), np.float64)
    level[:, _N] = UNKNOWN
    level[occupied] = lifted
    for step in (1 << k for k in range(LEVELS + 1)):
        _interpolate(level, columns // step, rows // step, cells, step, bound)
        if step < 1 << LEVELS:
            coarse = workspace.take(f"level {step}", (len(level) // 4, 4), np.float64)
            _coarsen(level, columns // step, coarse)
            level = coarse
    _fold_lines(bound)
    return bound


@compiled
def _coarsen(level: Any, columns: int, coarse: Any) -> None:
    """Of each four cells keep the nearest point."""
    half = columns // 2
    for k in range(coarse.shape[0]):
        first = k // half * 2 * columns + k % half * 2
        best = first
        for other in (first + 1, first + columns, first + columns + 1):
            if level[other, _N] < level[best, _N]:
                best = other
        coarse[k] = level[best]


@compiled
def _height(level: Any, a: int, b: int, c: int, u: float, v: float) -> float:
    """Height at (u, v) of the counter-clockwise triangle of three points that holds it; else UNKNOWN."""
    au, av = level[a, _U] - u, level[a, _V] - v
    bu, bv = level[b, _U] - u, level[b, _V] - v
    cu, cv = level[c, _U] - u, level[c, _V] - v
    of_a, of_b, of_c = bu * cv - bv * cu, cu * av - cv * au, au * bv - av * bu
    area = of_a + of_b + of_c
    if of_a < 0 or of_b < 0 or of_c < 0 or area <= _THINNEST:
        return UNKNOWN
    return (of_a * level[a, _W] + of_b * level[b, _W] + of_c * level[c, _W]) / area


@compiled
def _interpolate(level: Any, columns: int, rows: int, cells: Cells, step: int, bound: Any) -> None:
    """Lower the bound where the four cells round a corner hold points, `step` cells of the grid apart."""
    size = cells.size * step
    for j in range(1, rows):
        v = cells.v0 + j * size
        for i in range(1, columns):
            # The points lie in the four quadrants round the corner, so some triangle of three holds it.
            ne = j * columns + i
            nw, se = ne - 1, ne - columns
            sw = se - 1
            if max(max(level[ne, _N], level[nw, _N]), max(level[se, _N], level[sw, _N])) >= UNKNOWN:
                continue
            u = cells.u0 + i * size
            low = min(
                min(_height(level, ne, nw, sw, u, v), _height(level, ne, sw, se, u, v)),
                min(_height(level, nw, sw, se, u, v), _height(level, nw, se, ne, u, v)),
            )
            bound[j * step, i * step] = min(bound[j * step, i * step], low)


@compiled
def _fold_line(line: Any, first: int, stride: int, count: int, at: Any, height: Any) -> None:
    """Replace the bounds along a line of corners by their lower convex envelope."""
    held = 0
    for i in range(count):
        y = line[first + i * stride]
        if y >= UNKNOWN:
            continue
        while held >= 2:
            run, rise = at[held - 1] - at[held - 2], height[held - 1] - height[held - 2]
            if rise * (i - at[held - 2]) < (y - height[held - 2]) * run:
                break
            held -= 1
        at[held], height[held] = i, y
        held += 1
    for k in range(held - 1):
        slope = (height[k + 1] - height[k]) / (at[k + 1] - at[k])
        for i in range(at[k] + 1, at[k + 1]):
            line[first + i * stride] = height[k] + slope * (i - at[k])


@compiled
def _fold_lines(bound: Any) -> None:
    """Fold along the diagonals, then along rows and columns."""
    rows, columns = bound.shape
    line = bound.reshape(-1)
    at, height = np.empty(max(rows, columns), np.int64), np.empty(max(rows, columns))
    for i in range(columns):
        _fold_line(line, i, columns + 1, min(columns - i, rows), at, height)
        _fold_line(line, i, columns - 1, min(i + 1, rows), at, height)
    for j in range(1, rows):
        _fold_line(line, j * columns, columns + 1, min(columns, rows - j), at, height)
        _fold_line(line, (j + 1) * columns - 1, columns - 1, min(columns, rows - j), at, height)
    for j in range(rows):
        _fold_line(line, j * columns, 1, columns, at, height)
    for i in range(columns):
        _fold_line(line, i, columns, rows, at, height)
