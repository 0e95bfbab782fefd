"""Robust least squares over views: Levenberg-Marquardt on Huber's loss, with the covariance of what it finds.

Each view has a pose of its own that meets other views in the shared unknowns only, so the poses are
eliminated view by view (Schur complement): work and memory grow with the number of views, not its square.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from card.calibration.normal_equations import Normal, add, normal_of, reduced, scattered
from card.calibration.residuals import Block
from card.calibration.state import CORRECTIONS, SHARED, State
from card.errors import CardError

Array = NDArray[np.float64]

_MOST_STEPS = 60
_SCALE_ROUNDS = 3
#: Of half the sum of squares, in units of its own sigmas: a step that gains less moves nothing that matters.
_GAIN = 1e-7


@dataclass(frozen=True)
class Problem:
    """What is to be fitted.

    blocks : the observations.
    sigmas : standard deviation of each block's residuals to begin with, in its unit.
    free : columns of the shared unknowns that may move.
    huber : residuals beyond this many sigmas lose weight.
    prior_sigma : (97,) of the LiDAR's corrections about zero.
    """

    blocks: Sequence[Block]
    sigmas: Sequence[float]
    free: NDArray[np.intp]
    huber: float
    prior_sigma: Array


@dataclass(frozen=True)
class Solution:
    """The fit.

    sigmas : standard deviation of each block's residuals, as found.
    covariance : (127, 127) of the shared unknowns; zero where they are fixed.
    residuals : of each block, (V, M) in its unit.
    cost : robust, half the sum of squares in units of the sigmas.
    """

    state: State
    sigmas: tuple[float, ...]
    covariance: Array
    residuals: tuple[Array, ...]
    cost: float

    def inliers(self, block: int, huber: float) -> NDArray[np.bool_]:
        """Which residuals (V, M) of a block keep their full weight."""
        return np.asarray(np.abs(self.residuals[block]) <= huber * self.sigmas[block])


def solve(state: State, problem: Problem) -> Solution:
    """Fit a problem from a starting state; the scale of each block is estimated with it.

    Scales follow Huber's proposal 2, with the degrees of freedom that the fit takes from each block (P. J.
    Huber and E. M. Ronchetti, "Robust Statistics", 2009, chapters 6 and 7).

    Raises
    ------
    CardError
        If some unknown does not follow from the observations.
    """
    sigmas = np.array(problem.sigmas, dtype=np.float64)
    for _ in range(_SCALE_ROUNDS):
        state = _minimised(state, problem, sigmas)
        parts = [_plain(block, state, sigma) for block, sigma in zip(problem.blocks, sigmas, strict=True)]
        whole = add([_prior(state, problem), *parts])
        free, inverse = problem.free, _covariance(whole, problem.free)
        for number, (block, part) in enumerate(zip(problem.blocks, parts, strict=True)):
            residual = block.residual(state) / sigmas[number]
            present = np.isfinite(residual)
            freedom = present.sum() - _taken(whole, part, inverse, free)
            psi = np.clip(residual[present], -problem.huber, problem.huber)
            sigmas[number] *= np.sqrt(np.sum(psi**2) / max(freedom, 1.0) / _expected_square(problem.huber))
    residuals = tuple(block.residual(state) for block in problem.blocks)
    informative = [_prior(state, problem)]
    for block, residual, sigma in zip(problem.blocks, residuals, sigmas, strict=True):
        # Asymptotic covariance of an M-estimate: E psi^2 / (E psi')^2 of least squares'.
        full = np.mean(np.abs(residual[np.isfinite(residual)]) <= problem.huber * sigma)
        information = full**2 / _expected_square(problem.huber)
        informative.append(_plain(block, state, float(sigma) / np.sqrt(information)))
    covariance = np.zeros((SHARED, SHARED))
    covariance[np.ix_(problem.free, problem.free)] = _covariance(add(informative), problem.free)
    cost = _cost(state, problem, sigmas)
    return Solution(state, tuple(float(sigma) for sigma in sigmas), covariance, residuals, cost)


def _minimised(state: State, problem: Problem, sigmas: Array) -> State:
    damping, cost = 1e-4, _cost(state, problem, sigmas)
    for _ in range(_MOST_STEPS):
        normal = add([_prior(state, problem), *_weighted(state, problem, sigmas)])
        for _ in range(12):
            shared, poses, gain = reduced(normal, problem.free, damping)
            tried = state.moved(scattered(shared, problem.free, SHARED), poses)
            new = _cost(tried, problem, sigmas)
            if new <= cost:
                break
            damping *= 10
        else:
            return state
        state, cost, damping = tried, new, damping / 10
        if gain < _GAIN * (1 + damping):
            break
    return state


def _weighted(state: State, problem: Problem, sigmas: Array) -> list[Normal]:
    normals = []
    for block, sigma in zip(problem.blocks, sigmas, strict=True):
        linear = block.linear(state)
        size = np.abs(linear.residual) / sigma
        weight = np.where(size <= problem.huber, 1.0, problem.huber / np.maximum(size, 1e-12))
        normals.append(normal_of(linear, block.columns, np.nan_to_num(weight) / sigma**2, SHARED))
    return normals


def _plain(block: Block, state: State, sigma: float) -> Normal:
    """Normal equations without robust weights."""
    linear = block.linear(state)
    return normal_of(linear, block.columns, np.isfinite(linear.residual) / sigma**2, SHARED)


def _prior(state: State, problem: Problem) -> Normal:
    views = len(state.left_from_board)
    weight = np.zeros(SHARED)
    weight[CORRECTIONS] = 1 / problem.prior_sigma**2
    gradient = np.zeros(SHARED)
    gradient[CORRECTIONS] = weight[CORRECTIONS] * state.corrections
    return Normal(
        np.diag(weight), gradient, np.zeros((views, SHARED, 6)), np.zeros((views, 6, 6)), np.zeros((views, 6))
    )


def _cost(state: State, problem: Problem, sigmas: Array) -> float:
    total = 0.5 * float(np.sum((state.corrections / problem.prior_sigma) ** 2))
    for block, sigma in zip(problem.blocks, sigmas, strict=True):
        residual = block.residual(state)
        size = np.abs(residual[np.isfinite(residual)]) / sigma
        k = problem.huber
        total += float(np.sum(np.where(size <= k, 0.5 * size**2, k * (size - 0.5 * k))))
    return total


def _covariance(normal: Normal, free: NDArray[np.intp]) -> Array:
    """Covariance (F, F) of the free shared unknowns, the poses taken out."""
    swept = normal.cross[:, free] @ np.linalg.inv(normal.pose)
    left = normal.shared[np.ix_(free, free)] - np.einsum(
        "vsi,vti->st", swept, normal.cross[:, free], optimize=True
    )
    # Unknowns differ by many powers of ten: bring them to one scale before judging the rank.
    scale = 1 / np.sqrt(np.maximum(np.diag(normal.shared)[free], 1e-300))
    values, vectors = np.linalg.eigh(left * np.outer(scale, scale))
    if not values[0] > 1e-13 * values[-1]:
        raise CardError("the views do not determine the calibration", found=f"rank below {len(free)}")
    return np.asarray((vectors / values) @ vectors.T * np.outer(scale, scale))


def _taken(whole: Normal, part: Normal, covariance: Array, free: NDArray[np.intp]) -> float:
    """Degrees of freedom that the fit takes from one block: the trace of its share of the information."""
    inverse = np.linalg.inv(whole.pose)
    swept = whole.cross[:, free] @ inverse  # (V, F, 6)
    between = np.einsum("st,vti->vsi", covariance, swept, optimize=True)
    poses = inverse + np.einsum("vsi,vsj->vij", swept, between, optimize=True)
    total = np.sum(covariance * part.shared[np.ix_(free, free)])
    total += np.sum(poses * part.pose) - 2 * np.sum(between * part.cross[:, free])
    return float(total)


def _expected_square(k: float) -> float:
    """E psi^2 of Huber's psi under the normal distribution."""
    inside = float(erf(k / np.sqrt(2)))
    density = float(np.exp(-k * k / 2) / np.sqrt(2 * np.pi))
    return inside - 2 * k * density + k * k * (1 - inside)
