"""One least squares over a session's drive: returns on planes, the IMU, drawing and makers' tolerances."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from card.calibration.drive.inertial import Inertial
from card.calibration.drive.inertial_kernels import UPPER
from card.calibration.drive.planes import Fit, PlaneLimits, Returns
from card.calibration.drive.rays import Rays
from card.calibration.drive.state import State
from card.estimation.imu import Imu, ImuNoise

Array = NDArray[np.float64]
#: The first knot fixes place and heading (m, rad), not roll and pitch; its velocity (m/s) is free.
FIXED, FREE_TILT, FREE_VELOCITY = 1e-5, 0.5, 30.0
#: Moves of a mounting, rad and m, below which more iterations change nothing that matters.
CONVERGED = np.array([1e-5, 2e-4])


@dataclass(frozen=True)
class Priors:
    """What is believed before the drive, with one sigma each.

    mounted (2, 4, 4) with sigma_rad, sigma_m (2,) : the drawing.  corrections, corrections_sigma
    (2, CORRECTIONS).  imu_sigma (12,) : of the upper triangles of gyro and accelerometer.
    """

    mounted: Array
    sigma_rad: Array
    sigma_m: Array
    corrections: Array
    corrections_sigma: Array
    imu_sigma: Array
    noise: ImuNoise
    start: Array

    def information(self, lidar: int) -> Array:
        """Information (6,) of the drawing about one mounting, rotation before translation."""
        return np.repeat([self.sigma_rad[lidar] ** -2, self.sigma_m[lidar] ** -2], 3)

    def add(self, state: State, H: Array, g: Array) -> None:
        """Add to H (P, P) and g (P,)."""
        at = state.columns
        for lidar in range(2):
            found = difference(self.mounted[lidar], state.mounted[lidar])
            _add(H, g, at.mountings + 6 * lidar, found, self.information(lidar))
        off = (state.corrections - self.corrections).ravel()
        _add(H, g, at.corrections, off, self.corrections_sigma.ravel() ** -2.0)
        first = difference(self.start, state.poses[0])
        _add(H, g, 0, first, np.array([FREE_TILT, FREE_TILT, FIXED, FIXED, FIXED, FIXED]) ** -2)
        _add(H, g, at.velocities, state.velocities[0], np.full(3, FREE_VELOCITY**-2))
        biases = np.concatenate([state.gyro_biases[0], state.accel_biases[0]])
        _add(H, g, at.biases, biases, np.repeat([self.noise.gyro_bias, self.noise.accel_bias], 3) ** -2)
        triangles = [m[entry] - np.eye(3)[entry] for m in matrices(state) for entry in UPPER]
        _add(H, g, at.triangles, np.array(triangles), self.imu_sigma**-2)


@dataclass(frozen=True)
class Solution:
    """The state, the covariance (C, C) of mountings, corrections and the IMU's triangles, and how all fits.

    imu_residuals (K-1,) : root of chi^2 / 15 of each interval.  steps : greatest move of a mounting in each
    iteration, (I, 2), rad and m.
    """

    state: State
    covariance: Array
    fit: Fit
    imu_residuals: Array
    steps: Array


def solve(state: State, rays: Rays, imu: Imu, priors: Priors, settings: Mapping[str, Any]) -> Solution:
    """Gauss-Newton from a start, whose planes may be thick, to thin ones; each iteration maps anew."""
    gravity = settings["gravity_m_s2"]
    inertial = Inertial(imu, state.t_ns, priors.noise, gravity)
    dense_ns = imu.t_ns[(imu.t_ns >= state.t_ns[0]) & (imu.t_ns <= state.t_ns[-1])]
    returns = Returns(rays, state.t_ns, dense_ns)
    at, steps = state.columns, []
    narrowing = settings["plane_thickness_m"]
    for k in range(len(narrowing) + settings["max_iterations"]):
        H, g = np.zeros((at.size, at.size)), np.zeros(at.size)
        limits = PlaneLimits.from_settings(settings, narrowing[min(k, len(narrowing) - 1)])
        fit = returns.add(state, state.trajectory(imu, gravity), limits, H, g)
        squares = inertial.add(state, H, g)
        priors.add(state, H, g)
        # Units lie far apart: the normal equations are scaled.
        scale = 1.0 / np.sqrt(np.diag(H))
        factor = cho_factor(H * scale[:, None] * scale, lower=True, check_finite=False)
        step = scale * cho_solve(factor, scale * g, check_finite=False)
        moved = step[at.mountings : at.corrections].reshape(2, 2, 3)
        steps.append(np.linalg.norm(moved, axis=2).max(axis=0))
        state = state.moved(step)
        if k >= len(narrowing) and np.all(steps[-1] < CONVERGED):
            break
    wanted = np.r_[at.mountings : at.lidar_size, at.triangles : at.size]
    unit = np.zeros((at.size, len(wanted)))
    unit[wanted, np.arange(len(wanted))] = scale[wanted]
    covariance = (scale[:, None] * cho_solve(factor, unit, check_finite=False))[wanted]
    return Solution(state, 0.5 * (covariance + covariance.T), fit, np.sqrt(squares / 15), np.stack(steps))


def difference(believed: Array, found: Array) -> Array:
    """What has to be done to one pose on its right (6,) to have the other: rotation vector, translation."""
    turn = believed[:3, :3].T @ found[:3, :3]
    return np.concatenate(
        [Rotation.from_matrix(turn).as_rotvec(), found[:3, :3].T @ (found[:3, 3] - believed[:3, 3])]
    )


def matrices(state: State) -> tuple[Array, Array]:
    """Upper triangular (3, 3) of gyro and accelerometer."""
    return state.gyro_matrix, state.accel_matrix


def _add(H: Array, g: Array, first: int, residual: Array, information: Array) -> None:
    rows = np.arange(first, first + len(residual))
    H[rows, rows] += information
    g[rows] -= information * residual
