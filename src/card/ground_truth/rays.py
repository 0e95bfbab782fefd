"""The rays of one sweep, from where the moving sensor fired them to their returns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from card.ground_truth.sweeps import Drive, Sweep

#: Poses a sweep is divided into; between them a sensor moves on a straight line.
POSES = 256


def pose_times(start_ns: int, end_ns: int) -> npt.NDArray[np.int64]:
    """Times (POSES,) evenly spaced over a sweep, both ends included."""
    # As offsets: float64 does not resolve nanoseconds since 1970.
    return start_ns + np.rint(np.linspace(0, end_ns - start_ns, POSES)).astype(np.int64)


def ray_origins(drive: Drive, i: int, sweep: Sweep) -> npt.NDArray[np.float64]:
    """Where the sensor of burst `i` was when it fired each point (N, 3), world, metres."""
    times = pose_times(int(drive.start_ns[i]), int(drive.end_ns[i]))
    places = drive.poses(i, times)[:, :3, 3]
    at = (sweep.time_ns - times[0]) / max(int(times[-1] - times[0]), 1) * (POSES - 1)
    low = np.minimum(at.astype(np.int64), POSES - 2)
    share = (at - low)[:, None]
    origins: npt.NDArray[np.float64] = (1 - share) * places[low] + share * places[low + 1]
    return origins
