"""Square cells over the image plane (u, v), and the nearest point in each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled

#: Width of a cell in u and v where points are dense; some eight pixels of the left camera. It decides the
#: time it takes, not the result.
CELL = 1 / 200
#: Most cells along an axis. The order of insertion divides each cell by PARTS along each axis: two places of
#: thirteen bits make one Morton number.
MAX_CELLS = 1900
PARTS = 4
#: Times that the grid is coarsened by two, and the multiple of cells along each axis that this needs.
LEVELS = 4
ALIGN = 1 << LEVELS
#: Marks a cell without a point.
EMPTY = np.uint64(0xFFFFFFFFFFFFFFFF)
_INDEX = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)


class Cells(NamedTuple):
    """A grid of rows x columns cells of width `size`, from (u0, v0)."""

    u0: float
    v0: float
    size: float
    columns: int
    rows: int


@compiled
def survey(points: Any, reach: float) -> tuple[float, float, float, float, int]:
    """Bounds (u low, u high, v low, v high) of points (N, 3), and the first that has no place in the map.

    That is a point that is not in front of the viewer, z > 0, or not within `reach` (m) of it; -1 if all
    have one.
    """
    u_low = v_low = np.inf
    u_high = v_high = -np.inf
    limit = reach * reach
    misfits = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        misfits += not (z > 0 and x * x + y * y + z * z < limit)
        u, v = x / z, y / z
        u_low, u_high = min(u_low, u), max(u_high, u)
        v_low, v_high = min(v_low, v), max(v_high, v)
    bad = -1
    if misfits:
        for i in range(points.shape[0]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            if not (z > 0 and x * x + y * y + z * z < limit):
                bad = i
                break
    return u_low, u_high, v_low, v_high, bad


def lay_out(u_low: float, u_high: float, v_low: float, v_high: float, points: int) -> Cells:
    """A grid that holds the bounds with half a cell to spare, and not many more cells than points."""
    width, height = u_high - u_low, v_high - v_low
    size = max(CELL, max(width, height) / MAX_CELLS, float(np.sqrt(width * height / points)))
    u0, v0 = u_low - size / 2, v_low - size / 2
    columns, rows = int((u_high - u0) / size) + 1, int((v_high - v0) / size) + 1
    return Cells(u0, v0, size, -(-columns // ALIGN) * ALIGN, -(-rows // ALIGN) * ALIGN)


@compiled
def assign(points: Any, cells: Cells, cell: Any, range2: Any, nearest: Any) -> None:
    """Write cell (N,) uint32 and squared range (N,) float32 of each point, and the nearest of each cell.

    nearest : (cells,) uint64, the bits of the squared range above the point's index; EMPTY to begin with.
        Of points at the same range the first counts.
    """
    bits = range2.view(np.uint32)
    per_cell = 1.0 / cells.size
    block = 1024
    for start in range(0, points.shape[0], block):
        stop = min(start + block, points.shape[0])
        # Two loops: the first one has no memory to jump about in, so it runs on vector registers.
        for i in range(start, stop):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            inverse = 1.0 / z
            column = np.int32((x * inverse - cells.u0) * per_cell)
            row = np.int32((y * inverse - cells.v0) * per_cell)
            cell[i] = np.uint32(row * np.int32(cells.columns) + column)
            range2[i] = np.float32(x * x + y * y + z * z)
        for i in range(start, stop):
            rank = (np.uint64(bits[i]) << _SHIFT) | np.uint64(i)
            if rank < nearest[cell[i]]:
                nearest[cell[i]] = rank


@compiled
def place_all(points: Any, cells: Cells, place: Any) -> None:
    """Write the place (N, 2) uint16 of each point, along u and v, in parts of a cell."""
    per_cell = PARTS / cells.size
    for i in range(points.shape[0]):
        inverse = 1.0 / points[i, 2]
        place[i, 0] = np.int32((points[i, 0] * inverse - cells.u0) * per_cell)
        place[i, 1] = np.int32((points[i, 1] * inverse - cells.v0) * per_cell)


@compiled
def reach(points: Any) -> float:
    """Range, metres, of the point (N, 3) farthest from the viewer."""
    farthest = 0.0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        farthest = max(farthest, x * x + y * y + z * z)
    return np.sqrt(farthest)


def indices(nearest: npt.NDArray[np.uint64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Cells that hold a point (M,), and the nearest point (M,) of each."""
    occupied = np.flatnonzero(nearest != EMPTY)
    return occupied, (nearest[occupied] & _INDEX).astype(np.int64)
