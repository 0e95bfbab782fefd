"""The poses of a path that are a step apart, compiled."""

from typing import Any

import numba
import numpy as np

_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def knots(position: Any, min_step_m: float) -> Any:
    """Indices (M,) of the places (N, 3), N >= 1, that are at least a step from the one taken before.

    The rest after the last of them is shorter than a step: the last one moves to the end, if that leaves it
    a step from the one before.
    """
    kept, count = np.empty(len(position), dtype=np.int64), 1
    kept[0] = 0
    for i in range(len(position)):
        if _distance(position[i], position[kept[count - 1]]) >= min_step_m:
            kept[count] = i
            count += 1
    end = len(position) - 1
    if count > 1 and _distance(position[end], position[kept[count - 2]]) >= min_step_m:
        kept[count - 1] = end
    return kept[:count].copy()


@_compiled
def _distance(a: Any, b: Any) -> float:
    total = 0.0
    for axis in range(3):
        total += (a[axis] - b[axis]) ** 2
    return np.sqrt(total)
