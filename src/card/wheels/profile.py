"""The road's elevation along a path: a robust smoothing spline."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]
#: Keeps a piece of spline that no point touches solvable; far below what a single point weighs.
RIDGE = 1e-9
MAX_ITERATIONS = 100
CONVERGED_M = 1e-7


@dataclass(frozen=True)
class SplineSettings:
    """Settings of the fit; see ``settings/wheels``."""

    knot_spacing_m: float
    tukey_m: float
    tukey_start_m: float
    anneal_factor: float
    penalty: float
    penalty_anneal_power: float


@dataclass(frozen=True)
class Profile:
    """A uniform cubic B-spline: knots from `start_m` every `spacing_m`, coefficients (K,) in metres."""

    start_m: float
    spacing_m: float
    coefficients: Array

    def at(self, arc: ArrayLike) -> Array:
        """Heights (...) in metres at arc lengths (...)."""
        first, basis = uniform_basis(arc, self.start_m, self.spacing_m, len(self.coefficients))
        return np.einsum("...k,...k->...", basis, self.coefficients[first[..., None] + np.arange(4)])


def uniform_basis(
    arc: ArrayLike, start_m: float, spacing_m: float, count: int
) -> tuple[NDArray[np.int64], Array]:
    """First coefficient (...) and values (..., 4) of the four cubic B-splines alive at each arc length."""
    position = (np.asarray(arc, dtype=np.float64) - start_m) / spacing_m
    first = np.clip(np.floor(position).astype(np.int64), 0, count - 4)
    u = position - first
    v = 1 - u
    basis = np.stack([v**3, 3 * u**3 - 6 * u**2 + 4, 3 * v**3 - 6 * v**2 + 4, u**3], axis=-1) / 6
    return first, basis


def tukey_weights(residual: Array, scale: float) -> Array:
    """Tukey's biweight (N,) of residuals (N,): (1 - (r / scale)^2)^2 inside the scale, else 0."""
    return np.maximum(0.0, 1 - np.square(residual / scale)) ** 2


def fit_profile(
    arc: Array, height: Array, settings: SplineSettings, guess: Array | None = None
) -> tuple[Profile, Array]:
    """The spline through points (N,), N >= 1, and the Tukey weight (N,) each point ends with.

    `guess` (N,) is about how high the road is at each point, metres; 0 if not given.

    Minimises the sum of Tukey's loss over the heights plus the penalty times the squared second differences
    of the coefficients, by reweighted least squares (supplement, "Wheel Excitation"). The loss is annealed
    from wide to narrow, because from a bad start the narrow one locks on to an outlier cluster, and the
    spline is stiffer while the loss is wide, so that a cluster is outvoted by the road before and behind it.
    """
    spacing = settings.knot_spacing_m
    # One interval more at each end, where the penalty alone continues the spline.
    start = float(arc.min()) - spacing
    count = int(np.ceil((float(arc.max()) - start) / spacing)) + 4
    first, basis = uniform_basis(arc, start, spacing, count)
    coefficients = np.zeros(count)
    scale = settings.tukey_start_m
    fitted = np.zeros(len(arc)) if guess is None else guess
    for _ in range(MAX_ITERATIONS):
        weights = tukey_weights(height - fitted, scale)
        stiffness = (scale / settings.tukey_m) ** settings.penalty_anneal_power
        solution = _solve(first, basis, height, weights, _penalty_band(count, settings.penalty * stiffness))
        step = float(np.abs(solution - coefficients).max())
        coefficients, fitted = solution, _evaluate(first, basis, solution)
        if scale == settings.tukey_m and step < CONVERGED_M:
            break
        scale = max(scale * settings.anneal_factor, settings.tukey_m)
    return Profile(start, spacing, coefficients), tukey_weights(height - fitted, settings.tukey_m)


def _evaluate(first: NDArray[np.int64], basis: Array, coefficients: Array) -> Array:
    value = basis[:, 0] * coefficients[first]
    for k in range(1, 4):
        value += basis[:, k] * coefficients[first + k]
    return value


def _solve(first: NDArray[np.int64], basis: Array, height: Array, weights: Array, band: Array) -> Array:
    """Coefficients (K,) of the normal equations, added to the lower `band` (4, K) of the penalty."""
    count = band.shape[1]
    right = np.zeros(count)
    for a in range(4):
        weighted = weights * basis[:, a]
        right += np.bincount(first + a, weighted * height, minlength=count)
        for b in range(a, 4):
            band[b - a] += np.bincount(first + a, weighted * basis[:, b], minlength=count)
    return solveh_banded(band, right, lower=True, overwrite_ab=True, overwrite_b=True)


def _penalty_band(count: int, penalty: float) -> Array:
    """Lower band (4, K) of penalty * D^T D with D the second differences, plus the ridge."""
    band = np.zeros((4, count))
    difference = (1.0, -2.0, 1.0)
    for a in range(3):
        for b in range(a, 3):
            band[b - a, a : a + count - 2] += penalty * difference[a] * difference[b]
    band[0] += RIDGE
    return band
