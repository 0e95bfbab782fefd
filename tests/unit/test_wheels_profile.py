"""The robust spline against scipy's optimizer, a known bump, clusters and gaps."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from card.artifacts import default_settings
from card.wheels.normal_equations import RIDGE, NormalEquations, uniform_basis
from card.wheels.profile import Profile, SplineSettings, fit_profile, tukey_weights

Array = NDArray[np.float64]


def settings(**changes: float) -> SplineSettings:
    defaults = default_settings("wheels") | changes
    return SplineSettings(**{name: defaults[name] for name in SplineSettings.__dataclass_fields__})


def fit(arc: Array, height: Array, chosen: SplineSettings | None = None) -> tuple[Profile, Array]:
    """Profile and weights of points (N,) in any order that are spread over the corridor."""
    order = np.argsort(arc, kind="stable")
    sideways = np.random.default_rng(9).uniform(-0.12, 0.12, len(arc))
    profile, _, sorted_weight = fit_profile(arc[order], sideways, height[order], chosen or settings())
    weight = np.empty_like(sorted_weight)
    weight[order] = sorted_weight
    return profile, weight


def bump(arc: Array) -> Array:
    """A speed bump: a raised cosine, 8 cm high and 4 m long, at 20 m."""
    inside = np.abs(arc - 20) < 2
    return np.where(inside, 0.04 * (1 + np.cos(np.pi * (arc - 20) / 2)), 0.0)


def test_basis_agrees_with_scipy() -> None:
    arc = np.linspace(1.0, 3.0, 57)
    first, basis = uniform_basis(arc, 1.0, 0.2, 13)
    coefficients = np.random.default_rng(0).normal(size=13)
    spline = BSpline(1.0 + 0.2 * np.arange(-3, 14), coefficients, 3)
    np.testing.assert_allclose(
        (basis * coefficients[first[:, None] + np.arange(4)]).sum(axis=1), spline(arc), atol=1e-14
    )


def test_agrees_with_least_squares_and_a_tukey_loss() -> None:
    rng = np.random.default_rng(1)
    arc = np.sort(rng.uniform(0, 8, 600))
    sideways = rng.uniform(-0.12, 0.12, arc.size)
    height = 0.03 * np.sin(2 * arc) + 0.1 * sideways + rng.normal(0, 0.004, arc.size)
    height[::9] += rng.uniform(0.06, 0.3, height[::9].size)
    chosen = settings()
    profile, _, weight = fit_profile(arc, sideways, height, chosen)
    assert 0 < np.count_nonzero(weight == 0) < 100

    count = len(profile.coefficients)
    along = design_matrix(arc, profile)
    design = np.hstack([along, along * (sideways / chosen.corridor_half_width_m)[:, None]])
    penalty = np.zeros((2 * count - 2, 2 * count))
    penalty[: count - 2, :count] = np.sqrt(chosen.penalty) * np.diff(np.eye(count), 2, axis=0)
    penalty[count - 2 :, count:] = np.sqrt(chosen.tilt_penalty) * np.eye(count)
    scale = chosen.tukey_m

    def residuals(coefficients: Array) -> Array:
        return np.concatenate([design @ coefficients - height, penalty @ coefficients])

    def loss(z: Array) -> Array:
        """Tukey for the heights, plain squares for the penalties; z = squared residual over scale^2."""
        inside = np.maximum(0.0, 1 - z)
        rho = np.stack([(1 - inside**3) / 3, inside**2, -2 * inside])
        rho[:, arc.size :] = np.stack([z[arc.size :], np.ones(len(penalty)), np.zeros(len(penalty))])
        return rho

    start = profile.coefficients.T.ravel() + 0.002
    witness = least_squares(
        residuals,
        start,
        lambda _: np.vstack([design, penalty]),
        loss=loss,
        f_scale=scale,
        xtol=1e-14,
        ftol=1e-15,
    )
    assert witness.success
    np.testing.assert_allclose(profile.coefficients.T.ravel(), witness.x, atol=1e-5)


def design_matrix(arc: Array, profile: Profile) -> Array:
    """B-splines (N, K) of a profile at arc lengths (N,), by scipy."""
    knots = profile.start_m + profile.spacing_m * np.arange(-3, len(profile.coefficients) + 1)
    return BSpline.design_matrix(arc, knots, 3).toarray()


def test_compiled_and_plain_fits_agree_to_the_bit() -> None:
    """Sums in machine code by sums in numpy; and a solution where something moved by one from scratch, over
    a hole in the points and clusters that keep some places moving for long."""
    rng = np.random.default_rng(5)
    arc = np.sort(np.concatenate([rng.uniform(0, 30, 5000), rng.uniform(34, 60, 4000)]))
    sideways, height = rng.uniform(-0.12, 0.12, arc.size), bump(arc) + rng.normal(0, 0.01, arc.size)
    cluster = (arc % 11 > 10) & (rng.uniform(size=arc.size) < 0.5)
    height[cluster] += 0.07
    fast, slow = (fit_profile(arc, sideways, height, settings(), compiled=way) for way in (True, False))
    np.testing.assert_array_equal(fast[0].coefficients, slow[0].coefficients)
    np.testing.assert_array_equal(fast[0].variance, slow[0].variance)
    np.testing.assert_array_equal(fast[1], slow[1])
    np.testing.assert_array_equal(fast[2], slow[2])


def test_solutions_are_those_of_the_dense_equations() -> None:
    """The first one, one with weights changed in the middle, and one with other penalties."""
    rng = np.random.default_rng(8)
    arc, across = np.sort(rng.uniform(0, 12, 900)), rng.uniform(-1, 1, 900)
    weight, height = rng.uniform(0, 1, arc.size), rng.normal(0, 0.1, arc.size)
    count = 124
    along = design_matrix(arc, Profile(-0.1, 0.1, np.zeros((count, 2)), np.zeros((count, 4))))
    design = np.hstack([along, along * across[:, None]])
    second = np.diff(np.eye(count), 2, axis=0)
    equations = NormalEquations(arc, across, height, -0.1, 0.1, count, True)
    intervals = np.ones(count - 3, dtype=bool)
    for penalties in ((0.02, 1.0), (0.02, 1.0), (0.5, 3.0)):
        equations.weigh(weight[equations.points(intervals)], intervals)
        normal = design.T @ (weight[:, None] * design) + RIDGE * np.eye(2 * count)
        normal[:count, :count] += penalties[0] * second.T @ second
        normal[count:, count:] += penalties[1] * np.eye(count)
        wanted = np.linalg.solve(normal, design.T @ (weight * height)).reshape(2, count).T
        found = equations.solve(*penalties)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10)
        intervals[:] = False
        intervals[40:43] = True
        weight[equations.points(intervals)] = 0.3
    weight[:] = -1.0
    equations.weigh(weight[equations.points(intervals)], intervals)
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        equations.solve(0.02, 1.0)


def test_variance_is_that_of_the_inverse() -> None:
    rng = np.random.default_rng(6)
    arc, across = np.sort(rng.uniform(0, 3, 90)), rng.uniform(-1, 1, 90)
    weight = rng.uniform(0, 1, arc.size)
    equations = NormalEquations(arc, across, np.zeros(arc.size), -0.1, 0.1, 34, True)
    equations.weigh(weight, np.ones(31, dtype=bool))
    equations.solve(0.01, 1.0)
    variance = equations.variance()
    profile = Profile(-0.1, 0.1, np.zeros((34, 2)), variance)
    along = design_matrix(arc, profile)
    design = np.hstack([along, along * across[:, None]])
    second = np.diff(np.eye(34), 2, axis=0)
    normal = design.T @ (weight[:, None] * design)
    normal[:34, :34] += 0.01 * second.T @ second
    normal[34:, 34:] += np.eye(34)
    inverse = np.linalg.inv(normal)[:34, :34]
    for b in range(4):
        np.testing.assert_allclose(variance[: 34 - b, b], np.diagonal(inverse, b), rtol=1e-4)
    at = np.array([0.7, 1.31])
    basis = design_matrix(at, profile)
    found = profile.std_under(at, 0.0)
    np.testing.assert_allclose(found, np.sqrt(np.diagonal(basis @ inverse @ basis.T)), rtol=1e-4)


def test_spread_of_repeated_fits_is_the_standard_deviation() -> None:
    """Of points with noise, dense here and sparse there."""
    rng = np.random.default_rng(7)
    arc = np.sort(np.concatenate([rng.uniform(0, 6, 400), rng.uniform(6, 12, 40)]))
    sideways = rng.uniform(-0.12, 0.12, arc.size)
    at, found = np.array([3.0, 9.0]), []
    chosen = settings(knot_spacing_m=0.1, penalty=0.01)
    for _ in range(300):
        profile, _, _ = fit_profile(arc, sideways, rng.normal(0, 0.004, arc.size), chosen)
        found.append(profile.at(at))
    spread = np.std(found, axis=0)
    assert spread[1] > 2 * spread[0]
    # The inverse counts the penalty as knowledge and Tukey's weights lose a little.
    ratio = spread / (0.004 * profile.std_under(at, 0.0))
    assert (ratio > 0.6).all()
    assert (ratio < 1.1).all()


def test_recovers_a_bump_from_exact_points() -> None:
    arc = np.random.default_rng(2).uniform(0, 40, 4000)
    profile, _ = fit(arc, bump(arc))
    at = np.linspace(0.5, 39.5, 2000)
    assert np.abs(profile.at(at) - bump(at)).max() < 1e-3


def test_noise_averages_out() -> None:
    rng = np.random.default_rng(3)
    arc = rng.uniform(0, 40, 8000)
    profile, _ = fit(arc, bump(arc) + rng.normal(0, 0.008, arc.size))
    at = np.linspace(0.5, 39.5, 2000)
    assert np.sqrt(np.mean((profile.at(at) - bump(at)) ** 2)) < 2e-3


def test_outlier_clusters_do_not_pull() -> None:
    rng = np.random.default_rng(4)
    arc = rng.uniform(0, 40, 6000)
    height = bump(arc) + rng.normal(0, 0.004, arc.size)
    # A passing wheel: 45 % of the points of a stretch lie together, 20 cm up; dust everywhere.
    cluster = (np.abs(arc - 10) < 1) & (rng.uniform(size=arc.size) < 0.45)
    height[cluster] = 0.2 + rng.normal(0, 0.01, np.count_nonzero(cluster))
    dust = rng.uniform(size=arc.size) < 0.08
    height[dust] = rng.uniform(0, 0.35, np.count_nonzero(dust))
    profile, weight = fit(arc, height)
    at = np.linspace(0.5, 39.5, 2000)
    assert np.abs(profile.under(at, 0.24) - bump(at)).max() < 5e-3
    assert not weight[cluster & ~dust].any()

    soft, _ = fit(arc, height, settings(penalty_anneal_power=0.0))
    assert np.abs(soft.at(at) - bump(at)).max() > 0.1
    unannealed, _ = fit(arc, height, settings(tukey_start_m=1e3, tukey_m=1e3))
    assert np.abs(unannealed.at(at) - bump(at)).max() > 0.05


def test_a_stretch_without_points_is_bridged_smoothly() -> None:
    arc = np.concatenate([np.linspace(0, 10, 500), np.linspace(13, 20, 350)])
    profile, _ = fit(arc, 0.01 * arc, settings(tukey_start_m=2.0))
    np.testing.assert_allclose(profile.at([11, 12]), [0.11, 0.12], atol=1e-4)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_points_still_give_a_profile(count: int) -> None:
    profile, weight = fit(np.full(count, 3.0), np.full(count, 0.1))
    assert profile.at(3.0) == pytest.approx(0.1, abs=1e-3)
    assert (weight > 0.9).all()


def test_tukey_weight_is_the_slope_of_its_loss() -> None:
    r, scale, step = np.linspace(-0.06, 0.06, 41), 0.04, 1e-7

    def half_loss(r: Array) -> Array:
        return scale**2 / 6 * (1 - np.maximum(0, 1 - (r / scale) ** 2) ** 3)

    slope = (half_loss(r + step) - half_loss(r - step)) / (2 * step)
    np.testing.assert_allclose(tukey_weights(r, scale) * r, slope, atol=1e-8)
