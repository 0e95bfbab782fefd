"""Points of a sweep brought to where they were at one time, compiled."""

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@numba.njit(cache=True)
def compensate(points: Array, offset_ns: Array, knots_ns: Array, poses: Array) -> Array:
    """Points (N, 3), each moved by the pose of its own time.

    offset_ns (N,) and knots_ns (K,), increasing, are on one clock. poses (K, 4, 4) at the knots; between two
    of them a point moves on a straight line, which at 200 Hz costs less than 0.01 mm. Times outside take the
    nearest knot.
    """
    result = np.empty((len(points), 3))
    last = len(knots_ns) - 2
    k = 0
    for n in range(len(points)):
        t = offset_ns[n]
        while k < last and t > knots_ns[k + 1]:
            k += 1
        while k > 0 and t < knots_ns[k]:
            k -= 1
        w = min(max((t - knots_ns[k]) / (knots_ns[k + 1] - knots_ns[k]), 0.0), 1.0)
        for i in range(3):
            value = 0.0
            for j in range(3):
                value += ((1.0 - w) * poses[k, i, j] + w * poses[k + 1, i, j]) * points[n, j]
            result[n, i] = value + (1.0 - w) * poses[k, i, 3] + w * poses[k + 1, i, 3]
    return result
