"""The road's elevation along a path: a robust smoothing spline."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from card.wheels.normal_equations import NormalEquations, uniform_basis

Array = NDArray[np.float64]
MAX_ITERATIONS = 400
CONVERGED_M = 1e-7
#: Gauss points along a footprint; a piece of spline between knots is of third degree.
FOOTPRINT_POINTS = 6


@dataclass(frozen=True)
class SplineSettings:
    """Settings of the fit; see ``settings/wheels``."""

    corridor_half_width_m: float
    knot_spacing_m: float
    tukey_m: float
    tukey_start_m: float
    anneal_factor: float
    penalty: float
    penalty_anneal_power: float
    tilt_penalty: float


@dataclass(frozen=True)
class Profile:
    """Uniform cubic B-splines with knots from `start_m` every `spacing_m`.

    coefficients : (K, 2) metres: of the elevation in the middle of the corridor, which is its mean over a
        symmetric footprint, and of what is added at the corridor's right edge and taken off at its left one.
    variance : (K, 4) of the elevation's coefficients, 1 over the weight of the points: (k, b) is the
        covariance of coefficients k and k + b, for points of unit variance.
    """

    start_m: float
    spacing_m: float
    coefficients: Array
    variance: Array

    def at(self, arc: ArrayLike) -> Array:
        """Elevations (...) in metres at arc lengths (...), in the middle of the corridor."""
        return self._value(arc, 0)

    def tilt_at(self, arc: ArrayLike) -> Array:
        """What the right edge of the corridor is higher than its middle (...), metres."""
        return self._value(arc, 1)

    def under(self, arc: ArrayLike, length_m: float) -> Array:
        """Mean elevations (...) over a footprint of this length around arc lengths (...)."""
        centre = np.asarray(arc, dtype=np.float64)
        total = np.zeros(centre.shape)
        for point, weight in zip(*np.polynomial.legendre.leggauss(FOOTPRINT_POINTS), strict=True):
            total += weight / 2 * self.at(centre + length_m / 2 * point)
        return total

    def std_under(self, arc: ArrayLike, length_m: float) -> Array:
        """Greatest standard deviation (...) of the elevation under a footprint if that of a point is 1."""
        centre = np.asarray(arc, dtype=np.float64)
        return np.max([self._std(centre + length_m * share) for share in (-0.5, 0.0, 0.5)], axis=0)

    def _std(self, arc: Array) -> Array:
        first, basis = uniform_basis(arc, self.start_m, self.spacing_m, len(self.coefficients))
        total = np.zeros(first.shape)
        for a in range(4):
            for b in range(a, 4):
                share = basis[..., a] * basis[..., b] * self.variance[first + a, b - a]
                total += share if a == b else 2 * share
        return np.sqrt(np.maximum(total, 0.0))

    def _value(self, arc: ArrayLike, column: int) -> Array:
        first, basis = uniform_basis(arc, self.start_m, self.spacing_m, len(self.coefficients))
        return np.einsum("...k,...k->...", basis, self.coefficients[first[..., None] + np.arange(4), column])


def tukey_weights(residual: Array, scale: float) -> Array:
    """Tukey's biweight (N,) of residuals (N,): (1 - (r / scale)^2)^2 inside the scale, else 0."""
    inside = np.maximum(0.0, 1 - (residual / scale) * (residual / scale))
    return inside * inside


def fit_profile(
    arc: Array,
    sideways: Array,
    height: Array,
    settings: SplineSettings,
    guess: Array | None = None,
    compiled: bool = True,
) -> tuple[Profile, Array, Array]:
    """The splines through points (N,), N >= 1, the residual (N,) and the Tukey weight (N,) of each point.

    arc : (N,) in increasing order. sideways : (N,) offset to the right of the path. height : (N,). `guess`
    (N,) is about how high the road is at each point, 0 if not given. All in metres. compiled : whether the
    sums over the points are taken in machine code and the equations solved anew only where they changed; the
    plain form gives the same bits.

    Minimises the sum of Tukey's loss over the heights plus the penalty times the squared second differences
    of the coefficients, by reweighted least squares (supplement, "Wheel Excitation"). The loss is annealed
    from wide to narrow, because from a bad start the narrow one locks on to an outlier cluster, and the
    spline is stiffer while the loss is wide, so that a cluster is outvoted by the road before and behind it.

    The height may also tilt across the corridor, with a penalty of its own: over the edge of a pothole that
    the tyre meets with one side, a loss without it takes one of two levels and drops the other.
    """
    spacing = settings.knot_spacing_m
    # One interval more at each end, where the penalty alone continues the spline.
    start = float(arc.min()) - spacing
    count = int(np.ceil((float(arc.max()) - start) / spacing)) + 4
    across = sideways / settings.corridor_half_width_m
    equations = NormalEquations(arc, across, height, start, spacing, count, compiled)
    everywhere: NDArray[np.bool_] = np.ones(count - 3, dtype=np.bool_)
    moving, scale = everywhere, settings.tukey_start_m
    equations.weigh(tukey_weights(height - (0.0 if guess is None else guess), scale), everywhere)
    #: The coefficients that each interval was last weighed with.
    weighed = np.zeros((count - 3, 2, 4))
    for _ in range(MAX_ITERATIONS):
        stiffness = (scale / settings.tukey_m) ** settings.penalty_anneal_power
        coefficients = equations.solve(stiffness * settings.penalty, stiffness * settings.tilt_penalty)
        alive = sliding_window_view(coefficients, 4, axis=0)
        if scale == settings.tukey_m:
            # Most of a drive is at rest long before the last place where two surfaces vie.
            moving = equations.moved(coefficients, weighed, CONVERGED_M)
            if not moving.any():
                break
        scale = max(scale * settings.anneal_factor, settings.tukey_m)
        weighed[moving] = alive[moving]
        residual = equations.residual(coefficients, equations.points(moving))
        equations.weigh(tukey_weights(residual, scale), moving)
    residual = equations.residual(coefficients, equations.points(everywhere))
    profile = Profile(start, spacing, coefficients, equations.variance())
    return profile, residual, tukey_weights(residual, settings.tukey_m)
