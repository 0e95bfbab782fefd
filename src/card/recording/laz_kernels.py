"""Points as LAZ stores them, made those of a burst in one pass, compiled."""

from typing import Any

import numba
import numpy as np

_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def unpack(x: Any, y: Any, z: Any, ring: Any, offset_ns: Any, scales: Any, offsets: Any) -> Any:
    """Coordinates (N, 3), rings (N,) and times (N,) of fields of packed records (N,), and what there is to
    check of them: whether the coordinates are finite, the greatest ring and the greatest time.

    scales, offsets : (3,) of the coordinates, metres.
    """
    points = np.empty((len(x), 3))
    rings, times = np.empty(len(x), dtype=np.uint8), np.empty(len(x), dtype=np.uint32)
    last, late, finite = np.uint8(0), np.uint32(0), True
    for n in range(len(x)):
        points[n, 0] = x[n] * scales[0] + offsets[0]
        points[n, 1] = y[n] * scales[1] + offsets[1]
        points[n, 2] = z[n] * scales[2] + offsets[2]
        finite &= np.isfinite(points[n, 0] + points[n, 1] + points[n, 2])
        rings[n], times[n] = ring[n], offset_ns[n]
        last, late = max(last, rings[n]), max(late, times[n])
    return points, rings, times, (finite, last, late)
