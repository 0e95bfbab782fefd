"""Whether the covariances of rear LiDAR and IMU neither boast nor hide, at the level of measurements."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2
from session_yard import DRAWN_M, DRAWN_RAD, IMU_SIGMA, MAKER, yard

from card.artifacts import default_settings
from card.calibration.drive.batch import Priors, Solution, difference, matrices, solve
from card.calibration.drive.inertial_kernels import UPPER
from card.calibration.drive.state import State
from card.estimation.imu import ImuNoise
from card.simulation.imu import ImuErrors

Array = NDArray[np.float64]
#: The yard's planes are flat and every return errs on its own: none of them counts as less.
SETTINGS = {"gravity_m_s2": 9.81, "plane_points": 1e9, "min_plane_points": 8, "plane_sigma_m": 2e-4}
SCHEDULE = {"plane_thickness_m": [0.1, 0.03], "max_iterations": 10}


def estimate(seed: int, columns: int = 30) -> tuple[Solution, State]:
    """The solution for a drive from a drawing and makers' tolerances that are right, and the truth."""
    scene = yard(seed, columns=columns)
    truth, rng = scene.truth, np.random.default_rng([seed, 1])
    poses = truth.poses.copy()
    poses[1:, :3, 3] += rng.normal(0, 0.01, (len(poses) - 1, 3))
    corrections = np.zeros_like(truth.corrections)
    perfect = replace(truth, gyro_matrix=np.eye(3), accel_matrix=np.eye(3))
    start = replace(perfect, poses=poses, mounted=scene.drawn, corrections=corrections)
    unit = ImuErrors()
    noise = ImuNoise(
        unit.gyro_noise, unit.accel_noise, unit.gyro_walk, unit.accel_walk, unit.gyro_bias, unit.accel_bias
    )
    sigma = np.stack([MAKER, MAKER])
    drawn = np.full(2, DRAWN_RAD), np.full(2, DRAWN_M)
    priors = Priors(scene.drawn, *drawn, corrections, sigma, IMU_SIGMA, noise, truth.poses[0])
    settings = default_settings("calibration")["rear_and_imu"] | SETTINGS | SCHEDULE
    return solve(start, scene.rays, scene.imu, priors, settings), truth


def normalised(seed: int) -> Array:
    """Normalised error squared of the mountings, over 12, and of all that is estimated, over their number."""
    solution, truth = estimate(seed)
    state = solution.state
    mountings = [difference(t, f) for t, f in zip(truth.mounted, state.mounted, strict=True)]
    triangles = [
        found[entry] - true[entry]
        for true, found in zip(matrices(truth), matrices(state), strict=True)
        for entry in UPPER
    ]
    error = np.concatenate([*mountings, (state.corrections - truth.corrections).ravel(), triangles])
    few = error[:12] @ np.linalg.solve(solution.covariance[:12, :12], error[:12]) / 12
    return np.array([few, error @ np.linalg.solve(solution.covariance, error) / len(error)])


@pytest.mark.parametrize("seeds", [8, pytest.param(100, marks=pytest.mark.slow)])
def test_errors_are_as_large_as_the_covariance_says(seeds: int) -> None:
    few, everything = np.mean([normalised(seed) for seed in range(seeds)], axis=0)
    for mean, dimensions in ((few, 12), (everything, 12 + 2 * len(MAKER) + len(IMU_SIGMA))):
        low, high = chi2.interval(0.95, seeds * dimensions) / np.array(seeds * dimensions)
        assert low <= mean <= high, (mean, low, high)
