"""Which bursts a frame takes, and how much of its time windows they fill (paper, supplement D)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Times = npt.NDArray[np.int64]


def window_ns(t_ns: int, window_s: tuple[float, float]) -> tuple[int, int]:
    """Bounds, nanoseconds, of a window given in seconds around `t_ns`."""
    return t_ns + round(window_s[0] * 1e9), t_ns + round(window_s[1] * 1e9)


def overlapping(start_ns: Times, end_ns: Times, low_ns: int, high_ns: int) -> npt.NDArray[np.int64]:
    """Positions of the bursts [start, end] that share at least one instant with [low, high], both closed."""
    return np.flatnonzero((start_ns <= high_ns) & (end_ns >= low_ns))


def covered_share(start_ns: Times, low_ns: int, high_ns: int) -> float:
    """Share of [low, high] that the sweeps of one LiDAR cover, in [0, 1].

    Parameters
    ----------
    start_ns : (B,) increasing starts of all its bursts; a sweep lasts the median time between starts, so
        seconds of silence count as missing while the pause between two sweeps does not.
    """
    if len(start_ns) < 2 or high_ns <= low_ns:
        return 0.0
    period = float(np.median(np.diff(start_ns)))
    # A sweep that comes early ends where the next begins: nothing counts twice.
    ends = np.minimum(start_ns + period, np.r_[start_ns[1:], np.iinfo(np.int64).max])
    inside = np.minimum(ends, high_ns) - np.maximum(start_ns, low_ns)
    return float(np.clip(inside, 0, None).sum() / (high_ns - low_ns))
