"""The order in which the points of a frame are saved."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled


def raster_order(
    points: npt.NDArray[np.float64], column: npt.NDArray[np.int64], row: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The order of points (N, 3) by row (N,) and column (N,), not negative, then by z, x and y.

    The same as ``np.lexsort((y, x, z, column, row))`` but for points that are alike in all of these.
    """
    by_column = _counted(column, np.arange(len(points)))
    order = _counted(row, by_column)
    _sort_pixels(points, column, row, order)
    return order


@compiled
def _counted(values: Any, given: Any) -> Any:
    """The indices `given` (N,) in order of their values; equal ones as they come."""
    most = 0
    for i in given:
        most = max(most, values[i])
    start = np.zeros(most + 2, dtype=np.int64)
    for i in given:
        start[values[i] + 1] += 1
    for value in range(most + 1):
        start[value + 1] += start[value]
    order = np.empty(len(given), dtype=np.int64)
    for i in given:
        order[start[values[i]]] = i
        start[values[i]] += 1
    return order


@compiled
def _sort_pixels(points: Any, column: Any, row: Any, order: Any) -> None:
    """Put the few points of each pixel in order of z, x and y."""
    for k in range(1, len(order)):
        i, j = order[k], k
        while j > 0:
            other = order[j - 1]
            if column[other] != column[i] or row[other] != row[i]:
                break
            later = False
            for axis in (2, 0, 1):
                if points[other, axis] != points[i, axis]:
                    later = points[other, axis] > points[i, axis]
                    break
            if not later:
                break
            order[j] = other
            j -= 1
        order[j] = i
