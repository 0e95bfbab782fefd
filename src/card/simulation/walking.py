"""How walkers go: their way over the road's coordinates, and their limbs' swing on it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WALK_M_S = 1.3
#: Distance of a full stride of two steps, and the widest swing of legs and arms in rad.
STRIDE_M, LEG_SWING, ARM_SWING = 1.44, 0.42, 0.35
_CORNER_M, _GRID_M = 1.3, 0.1
#: A walker steps aside over this length before and after what stands in the way.
_ASIDE_M = 2.5


@dataclass(frozen=True)
class Way:
    """Where someone is at times (N,): arc length, offset, turn to the left of the road, and metres gone."""

    s: Array
    d: Array
    turn: Array
    gone: Array


def crossing(time: Array, s: float, lane: float, side: float, t: float, direction: int, along: int) -> Way:
    """Across the road at ``s``, in the middle of ``lane`` at ``t`` (s), to the right (1) or left (-1).

    The walker comes and goes along the sidewalks ``side`` m from the road's middle, in the sense ``along``.
    """
    reach = WALK_M_S * float(np.abs(time - t).max()) + 2 * side
    x = np.arange(-reach, reach + _GRID_M, _GRID_M)
    start, end = direction * (-direction * side - lane), direction * (direction * side - lane)
    path_s = s + along * (np.minimum(x - start, 0.0) + np.maximum(x - end, 0.0))
    path_d = lane + direction * np.clip(x, start, end)
    return _on(time, x, path_s, path_d, WALK_M_S * (time - t))


def strolling(time: Array, s: float, t: float, towards: bool, offset: Callable[[Array], Array]) -> Way:
    """Along the road, at ``s`` at time ``t`` (s); ``offset`` gives d by arc length."""
    sign = -1.0 if towards else 1.0
    reach = WALK_M_S * float(np.abs(time - t).max()) + 1.0
    x = np.arange(-reach, reach + _GRID_M, _GRID_M)
    return _on(time, x, s + sign * x, offset(s + sign * x), WALK_M_S * (time - t))


def aside(s: Array, obstacles: Sequence[float], half_length: float, usual: float, far: float) -> Array:
    """Offsets (N,) of a walker who keeps ``usual`` and makes for ``far`` beside obstacles at arc lengths."""
    share = np.zeros_like(s)
    for obstacle in obstacles:
        near = np.clip((half_length + _ASIDE_M - np.abs(s - obstacle)) / _ASIDE_M, 0.0, 1.0)
        share = np.maximum(share, near * near * (3 - 2 * near))
    return usual + share * (far - usual)


def swing(way: Way, step_s: float, widest: float, phase: float) -> Array:
    """Angle (N,) rad of a limb to the front: it swings with the way gone, and hangs when its owner stands."""
    pace = np.abs(np.gradient(way.gone, step_s)) / WALK_M_S
    return np.asarray(widest * np.clip(pace, 0.0, 1.0) * np.sin(2 * np.pi * way.gone / STRIDE_M + phase))


def _on(time: Array, x: Array, s: Array, d: Array, gone: Array) -> Way:
    """Positions at ``gone`` along a path (s, d) over ``x``, its corners rounded."""
    from scipy.ndimage import uniform_filter1d

    s, d = (uniform_filter1d(v, round(_CORNER_M / _GRID_M), mode="nearest") for v in (s, d))
    turn = np.unwrap(np.arctan2(-np.gradient(d, x), np.gradient(s, x)))
    return Way(np.interp(gone, x, s), np.interp(gone, x, d), np.interp(gone, x, turn), gone)
