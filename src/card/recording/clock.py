"""From the sensor's clock to the host's."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

# Over a shorter time the scatter of the host's stamps would pass for a skew.
_SKEW_AFTER_NS = 10_000_000_000


@dataclass(frozen=True)
class SensorClock:
    """host = sensor + offset_ns + skew * (sensor - reference_ns).

    delay_ns: median lateness of the host's stamps against this line, nanoseconds.
    """

    reference_ns: int
    offset_ns: int
    skew: float
    delay_ns: float

    def to_host(self, sensor_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """(N,) int64 nanoseconds on the sensor's clock -> on the host's."""
        since = sensor_ns - self.reference_ns
        return sensor_ns + self.offset_ns + np.rint(self.skew * since).astype(np.int64)


def fit_clock(sensor_ns: npt.NDArray[np.int64], host_ns: npt.NDArray[np.int64]) -> SensorClock:
    """Offset and skew from (N,) pairs of a packet's own time and the host's stamp on its arrival.

    A packet arrives late, never early: the clocks are related by the highest line that no stamp
    lies below (Moon, Skelly and Towsley, Estimation and removal of clock skew from network delay
    measurements, 1999). What is left is the least delay of the network, below a millisecond on a
    cable. Recordings under ten seconds get an offset alone.
    """
    reference = int(sensor_ns[0])
    base = int(host_ns[0] - sensor_ns[0])
    # Differences first: nanoseconds since 1970 do not fit a float64.
    x = (sensor_ns - reference).astype(np.float64)
    y = (host_ns - sensor_ns - base).astype(np.float64)
    if x[-1] - x[0] < _SKEW_AFTER_NS:
        slope, height = 0.0, float(y.min())
    else:
        slope, height = _supporting_line(x, y)
    return SensorClock(reference, base + round(height), slope, float(np.median(y - height - slope * x)))


def _supporting_line(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Slope and height at 0 of the line below all points with the least sum of distances.

    It is the edge of the lower convex hull under the mean of x.
    """
    hull: list[tuple[float, float]] = []
    for px, py in zip(x.tolist(), y.tolist(), strict=True):
        while len(hull) >= 2:
            (ax, ay), (bx, by) = hull[-2:]
            if (bx - ax) * (py - ay) > (by - ay) * (px - ax):
                break
            hull.pop()
        if hull and px <= hull[-1][0]:
            continue
        hull.append((px, py))
    middle = float(x.mean())
    for (ax, ay), (bx, by) in pairwise(hull):
        if bx >= middle:
            slope = (by - ay) / (bx - ax)
            return slope, ay - slope * ax
    raise AssertionError("the hull spans the mean of its points")
