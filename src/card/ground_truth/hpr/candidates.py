"""Points that may be visible: those that are not certainly above the lower hull.

The hull is convex over a cell, so it lies below the bilinear interpolation of its bounds K at the four
corners (Jensen): a point above that is hidden. Most are found by their range alone. With r the largest K/g of
the corners and h the width of the cell, bilinear interpolation of g stays below g (1 + h^2/4), because the
second derivatives of g are at most 1 and g at least 1. So W <= r g (1 + h^2/4) for every point that is kept,
which is n <= 2R (1 - 1 / (r (1 + h^2/4))).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from card.ground_truth.compiled import compiled
from card.ground_truth.hpr.cells import PARTS, Cells
from card.ground_truth.hpr.upper_bound import UNKNOWN

#: Relative room for rounding, of heights in float64 and of squared ranges in float32.
_HEIGHT_ROOM = 1e-12
_RANGE_ROOM = 1e-6


@compiled
def farthest(bound: Any, cells: Cells, diameter: float, limit: Any) -> None:
    """Write the largest squared range of a visible point of each cell, (cells,) float32, m^2."""
    factor = 1.0 + 0.25 * cells.size * cells.size + _HEIGHT_ROOM
    ratio = np.empty((2, cells.columns + 1))
    for j in range(cells.rows + 1):
        v = cells.v0 + j * cells.size
        above = ratio[j & 1]
        for i in range(cells.columns + 1):
            u = cells.u0 + i * cells.size
            above[i] = bound[j, i] / np.sqrt(1.0 + u * u + v * v)
        if j == 0:
            continue
        below = ratio[1 - (j & 1)]
        for i in range(cells.columns):
            r = max(max(above[i], above[i + 1]), max(below[i], below[i + 1])) * factor
            n = diameter * (1.0 - 1.0 / r)
            known = r < 1e-10 * UNKNOWN
            limit[(j - 1) * cells.columns + i] = np.float32(n * n * (1 + _RANGE_ROOM)) if known else np.inf


@compiled
def near_enough(cell: Any, range2: Any, limit: Any, kept: Any) -> int:
    """Write the indices of points within the limit of their cell to `kept` (N + 1,); return how many."""
    count = 0
    for i in range(cell.size):
        # Written always and counted if wanted: a branch would be guessed wrong too often.
        kept[count] = i
        count += range2[i] <= limit[cell[i]]
    return count


@compiled
def low_enough(lifted: Any, index: Any, bound: Any, cells: Cells, place: Any) -> int:
    """Move the lifted points (M, 4) that are not above the bilinear bound to the front; return how many.

    index : (M,) of the points, moved with them. place : (M, 2) output, as `cells.place_all` writes it.
    """
    per_cell = 1.0 / cells.size
    count = 0
    for i in range(index.size):
        x, y = (lifted[i, 0] - cells.u0) * per_cell, (lifted[i, 1] - cells.v0) * per_cell
        column, row = int(x), int(y)
        x -= column
        y -= row
        fine_x, fine_y = int(x * PARTS), int(y * PARTS)
        low = bound[row, column] + x * (bound[row, column + 1] - bound[row, column])
        high = bound[row + 1, column] + x * (bound[row + 1, column + 1] - bound[row + 1, column])
        height = lifted[i, 2]
        index[count] = index[i]
        for k in range(4):
            lifted[count, k] = lifted[i, k]
        place[count, 0], place[count, 1] = column * PARTS + fine_x, row * PARTS + fine_y
        count += height <= (low + y * (high - low)) * (1 + _HEIGHT_ROOM)
    return count
