"""A road's centre line: a smooth curve by arc length, open or closed."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
STEP_M = 0.5


class CentreLine:
    """Curve through the origin, heading along +y at s = 0.

    Parameters
    ----------
    curvature : (N,) 1/m, left positive, every STEP_M metres from ``start``.
    start : arc length of the first sample, m; <= 0.
    closed : whether the end meets the start, arc length then being periodic.
    """

    def __init__(self, curvature: ArrayLike, start: float = 0.0, *, closed: bool = False) -> None:
        from scipy.interpolate import CubicSpline

        k = np.asarray(curvature, dtype=np.float64)
        self.start, self.closed = start, closed
        self.length = STEP_M * len(k)
        s = start + STEP_M * np.arange(len(k) + 1)
        heading = np.concatenate([[0.0], np.cumsum(k) * STEP_M])
        middle = (heading[1:] + heading[:-1]) / 2
        steps = STEP_M * np.stack([-np.sin(middle), np.cos(middle)], axis=1)
        xy = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        if closed:
            xy -= np.linspace(0, 1, len(xy))[:, None] * xy[-1]
            xy[-1] = xy[0]
        origin = round(-start / STEP_M)
        xy -= xy[origin]
        c, si = np.cos(heading[origin]), np.sin(heading[origin])
        xy = xy @ np.array([[c, -si], [si, c]])
        middles = s[:-1] + STEP_M / 2
        around = np.concatenate([k[-3:], k, k[:3]]) if closed else np.pad(k, 3, mode="edge")
        self._bend = CubicSpline(middles[0] + STEP_M * np.arange(-3, len(k) + 3), around)
        self._curve = CubicSpline(s, xy, bc_type="periodic" if closed else "not-a-knot")

    def at(self, s: ArrayLike, derivative: int = 0) -> Array:
        """Position (..., 2) in metres, or its 1st or 2nd derivative by arc length."""
        return np.asarray(self._curve(self._wrapped(s), derivative))

    def curvature(self, s: ArrayLike) -> Array:
        """Curvature (...) in 1/m, left positive."""
        return np.asarray(self._bend(self._wrapped(s)))

    def _wrapped(self, s: ArrayLike) -> Array:
        s = np.asarray(s, dtype=np.float64)
        return self.start + np.mod(s - self.start, self.length) if self.closed else s

    def offset(self, s: ArrayLike, d: ArrayLike) -> Array:
        """Points (..., 2) at lateral offset d (m, right positive)."""
        tangent = self.at(s, 1)
        right = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
        right /= np.linalg.norm(tangent, axis=-1, keepdims=True)
        return self.at(s) + np.asarray(d)[..., None] * right

    def project(self, xy: Array, guess: ArrayLike) -> tuple[Array, Array]:
        """Arc length and lateral offset of points (..., 2) near arc lengths ``guess`` (Newton's method)."""
        s = np.array(guess, dtype=np.float64)
        for _ in range(4):
            gap, tangent = xy - self.at(s), self.at(s, 1)
            slope = np.sum(tangent * tangent, -1) - np.sum(gap * self.at(s, 2), -1)
            s += np.sum(gap * tangent, -1) / slope
        gap, tangent = xy - self.at(s), self.at(s, 1)
        across = gap[..., 0] * tangent[..., 1] - gap[..., 1] * tangent[..., 0]
        return s, across / np.linalg.norm(tangent, axis=-1)


def winding(length: float, start: float, bend: float, rng: np.random.Generator) -> CentreLine:
    """An open road of ``length`` m from ``start`` with smooth bends of at most ``bend`` 1/m."""
    s = np.arange(0.0, length, STEP_M)
    waves = [(rng.uniform(90, 260), rng.uniform(0, 2 * np.pi)) for _ in range(3)]
    k = sum(np.sin(2 * np.pi * s / wavelength + phase) for wavelength, phase in waves)
    return CentreLine(bend / 3 * np.asarray(k), start)


def circuit(straight: float, radius: float) -> CentreLine:
    """A closed left-hand circuit: two straights joined by half circles with eased ends."""
    half = round((straight + np.pi * radius) / STEP_M)
    turn = round(np.pi * radius / STEP_M)
    k = np.zeros(half)
    k[half // 2 - turn // 2 : half // 2 - turn // 2 + turn] = 1.0
    k = np.tile(k, 2)
    kernel = np.hanning(round(10.0 / STEP_M) + 2)[1:-1]
    reach = len(kernel)
    k = np.convolve(np.concatenate([k[-reach:], k, k[:reach]]), kernel / kernel.sum(), "same")[reach:-reach]
    return CentreLine(k * 2 * np.pi / (k.sum() * STEP_M), closed=True)
