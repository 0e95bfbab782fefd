"""Cars that keep their distance: the intelligent driver model."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Time gap (s), gap at standstill (m), acceleration and comfortable and hardest braking (m/s^2).
_HEADWAY_S, _JAM_GAP_M, _ACCELERATION, _BRAKING, _HARDEST = 1.2, 2.0, 1.5, 2.0, 8.0


@dataclass(frozen=True)
class Barrier:
    """What nobody passes at ``place`` (m) from time ``since`` to ``until`` (s)."""

    place: float
    since: float
    until: float


def flow(
    t: Array,
    start: Array,
    speed: float,
    desired: float,
    length: float,
    *,
    ahead: Array | None = None,
    ring: float | None = None,
    barrier: Barrier | None = None,
) -> Array:
    """Positions (N, C) m of the middles of C cars in a lane at times (N,) s, even steps apart.

    Treiber, Hennecke and Helbing, Congested traffic states in empirical observations and microscopic
    simulations, Physical Review E 62 (2000), eqs 1 to 3.

    Parameters
    ----------
    start : (C,) where they are at first, the foremost first.  speed : how fast then, m/s.
    desired : speed on an empty road, m/s.  length : of a car, m.
    ahead : (N,) rear end of what the foremost follows.  ring : length of a closed road, m.
    """
    x, v = start.astype(np.float64), np.full(len(start), speed)
    found = np.empty((len(t), len(start)))
    step = float(t[1] - t[0])
    for row, now in enumerate(t):
        found[row] = x
        front = x + length / 2
        first = np.inf if ahead is None else ahead[row]
        gap = np.concatenate([[first], x[:-1] - length / 2]) - front
        if ring is not None:
            gap[0] = x[-1] + ring - length / 2 - front[0]
        closing = v - np.concatenate([v[-1:] if ring is not None else v[:1], v[:-1]])
        if ahead is not None and row:
            closing[0] = v[0] - (ahead[row] - ahead[row - 1]) / step
        if barrier is not None and barrier.since <= now <= barrier.until:
            to_barrier = barrier.place - front
            to_barrier = np.mod(to_barrier, ring) if ring is not None else to_barrier
            stops = (to_barrier > 0) & (to_barrier < gap)
            gap, closing = np.where(stops, to_barrier, gap), np.where(stops, v, closing)
        wanted = _JAM_GAP_M + np.maximum(
            v * _HEADWAY_S + v * closing / (2 * np.sqrt(_ACCELERATION * _BRAKING)), 0.0
        )
        change = _ACCELERATION * (1 - (v / desired) ** 4 - (wanted / np.maximum(gap, 0.1)) ** 2)
        faster = np.maximum(v + step * np.maximum(change, -_HARDEST), 0.0)
        x, v = x + step * (v + faster) / 2, faster
    return found
