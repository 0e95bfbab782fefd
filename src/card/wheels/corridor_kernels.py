"""The points of a burst near a contact path, compiled: before they are in the world and after."""

from typing import Any

import numba
import numpy as np

# Floating point in the order written, so that the plain form agrees bit by bit.
_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
#: A cell is so much wider than its reach that rounding cannot push a place in reach past the cell beside.
WIDER = 1.0 + 1e-6


@_compiled
def _grid(places: Any, cell_m: float) -> Any:
    """A grid over the x and y of places (S, 2 or 3), S >= 1, and the first and the last (C,) of the places
    that lie in each of its cells or beside it; -1 is the last where there are none."""
    inverse = 1.0 / cell_m
    low_x, low_y = np.floor(places[:, 0].min() * inverse) - 1, np.floor(places[:, 1].min() * inverse) - 1
    rows = np.floor(places[:, 0].max() * inverse) - low_x + 2
    columns = np.floor(places[:, 1].max() * inverse) - low_y + 2
    grid = inverse, low_x, low_y, rows, columns
    first = np.full(int(rows * columns), len(places), dtype=np.int32)
    last = np.full(len(first), -1, dtype=np.int32)
    for s in range(len(places)):
        cell = _cell(grid, places[s, 0], places[s, 1])
        for row in range(-1, 2):
            for beside in range(cell + row * int(columns) - 1, cell + row * int(columns) + 2):
                first[beside] = min(first[beside], s)
                last[beside] = s
    return grid, first, last


@_compiled
def _cell(grid: Any, x: float, y: float) -> int:
    """The cell in which a point lies, or -1 off the grid."""
    inverse, low_x, low_y, rows, columns = grid
    row, column = np.floor(x * inverse) - low_x, np.floor(y * inverse) - low_y
    return int(row * columns + column) if 0 <= row < rows and 0 <= column < columns else -1


@_compiled
def near_cells(points: Any, places: Any, cell_m: float) -> Any:
    """Which of the points (N, 3) lie in x and y in the cell of one of the places (S, 2), S >= 1, or beside
    it, (Q,)."""
    grid, _, last = _grid(places, cell_m)
    found, count = np.empty(len(points), dtype=np.int64), 0
    for n in range(len(points)):
        cell = _cell(grid, points[n, 0], points[n, 1])
        if cell >= 0 and last[cell] >= 0:
            found[count] = n
            count += 1
    return found[:count].copy()


@_compiled
def corridor(
    points: Any,
    position: Any,
    rotation: Any,
    arc: Any,
    reach_m: float,
    half_width_m: float,
    max_height_m: float,
    window: Any,
) -> Any:
    """Arc length, height and sideways offset (3, Q) of the points (P, 3) in a corridor, and which they are.

    position, rotation, arc : (M, 3), (M, 3, 3), (M,) poses of the path, M >= 2. window : least and greatest
    arc length. `arc_height.project` has the equations; a point with no pose in reach is not in the corridor.
    """
    grid, first, last = _grid(position, WIDER * reach_m)
    found, which = np.empty((3, len(points))), np.empty(len(points), dtype=np.int64)
    count, end = 0, len(position) - 1
    for n in range(len(points)):
        p = points[n]
        cell = _cell(grid, p[0], p[1])
        nearest, least = -1, reach_m * reach_m
        for k in range(first[cell], last[cell] + 1) if cell >= 0 else range(0):
            squared = _squared(p, position[k])
            if squared < least:
                nearest, least = k, squared
        if nearest < 0:
            continue
        back = nearest == end
        if 0 < nearest < end:
            before, after = _squared(p, position[nearest - 1]), _squared(p, position[nearest + 1])
            back = np.sqrt(before) < np.sqrt(after)
        i = nearest if back else nearest + 1
        along, length = 0.0, 0.0
        for axis in range(3):
            step = position[i, axis] - position[i - 1, axis]
            along += step * (p[axis] - position[i - 1, axis])
            length += step * step
        alpha = along / length
        d = (1 - alpha) * arc[i - 1] + alpha * arc[i]
        h = _local(p, position, rotation, i, alpha, 2)
        sideways = _local(p, position, rotation, i, alpha, 0)
        if abs(sideways) <= half_width_m and abs(h) <= max_height_m and window[0] <= d <= window[1]:
            found[0, count], found[1, count], found[2, count], which[count] = d, h, sideways, n
            count += 1
    return found[:, :count].copy(), which[:count].copy()


@_compiled
def _squared(a: Any, b: Any) -> float:
    """Squared distance of two points (3,)."""
    total = 0.0
    for axis in range(3):
        total += (a[axis] - b[axis]) ** 2
    return total


@_compiled
def _local(p: Any, position: Any, rotation: Any, i: int, alpha: float, axis: int) -> float:
    """One coordinate of a point (3,) in the frames of the poses i - 1 and i, blended."""
    start, end = 0.0, 0.0
    for j in range(3):
        start += rotation[i - 1, j, axis] * (p[j] - position[i - 1, j])
        end += rotation[i, j, axis] * (p[j] - position[i, j])
    return (1 - alpha) * start + alpha * end
