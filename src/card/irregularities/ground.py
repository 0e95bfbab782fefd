"""The ground around a box: a crowned plane that what sticks out of it does not bend."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TUKEY = 4.685
"""Times the scale, residuals from here on count nothing: 95 % efficiency for normal ones."""
NORMAL_MAD = 1.4826
LEAST_SCALE_M = 0.003
START_ROUNDS, ROUNDS = 5, 15
TERMS = 4
"""Unknowns of a ground, and the fewest points that give one."""


@dataclass(frozen=True)
class Ground:
    """z = c . (1, x, y, x^2) about ``centre``, metres in rig: x runs across the road, which is crowned."""

    centre: Array
    coefficients: Array

    def above(self, points: Array) -> Array:
        """Heights (N,) of points (N, 3) over it, along z."""
        return np.asarray(points[:, 2] - self.centre[2] - _terms(points, self.centre) @ self.coefficients)


def fit_ground(points: Array) -> Ground:
    """Ground through points (N, 3), N >= `TERMS`, by least absolute residuals, then Tukey's biweight.

    A. E. Beaton and J. W. Tukey, "The Fitting of Power Series", Technometrics, 1974; iteratively reweighted.
    """
    centre = points.mean(axis=0)
    design = _terms(points, centre)
    z = points[:, 2] - centre[2]
    weights = np.ones(len(points))
    solution = np.zeros(TERMS)
    for turn in range(START_ROUNDS + ROUNDS):
        root = np.sqrt(weights)
        solution = np.linalg.lstsq(design * root[:, None], z * root, rcond=None)[0]
        residual = np.abs(z - design @ solution)
        if turn < START_ROUNDS:
            weights = 1 / np.maximum(residual, LEAST_SCALE_M)
            continue
        scale = max(NORMAL_MAD * float(np.median(residual)), LEAST_SCALE_M)
        weights = np.clip(1 - (residual / (TUKEY * scale)) ** 2, 0, None) ** 2
    return Ground(centre, solution)


def _terms(points: Array, centre: Array) -> Array:
    x, y = (points[:, :2] - centre[:2]).T
    return np.stack([np.ones_like(x), x, y, x * x], axis=1)
