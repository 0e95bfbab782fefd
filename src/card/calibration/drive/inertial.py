"""The IMU between knots as normal equations."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.calibration.drive.inertial_kernels import PARAMETERS, UPPER, preintegrate, skew
from card.calibration.drive.state import State
from card.estimation.imu import Imu, ImuNoise
from card.estimation.preintegration import INTEGRATION_VARIANCE

Array = NDArray[np.float64]


class Inertial:
    """All samples between the knots of a state, cut at them."""

    def __init__(self, imu: Imu, t_ns: NDArray[np.int64], noise: ImuNoise, gravity_m_s2: float) -> None:
        self._noise = noise
        self._gravity = np.array([0.0, 0.0, -gravity_m_s2])
        self._parts = [imu.between(int(a), int(b)) for a, b in pairwise(t_ns)]

    def residual(self, state: State, k: int) -> tuple[Array, Array, NDArray[np.intp], Array]:
        """Interval k: residual (15,), its derivatives (15, C) by the columns (C,), information (15, 15).

        Rotation, position and velocity, then the walk of gyro and accelerometer bias. C. Forster et al.,
        "On-Manifold Preintegration for Real-Time Visual-Inertial Odometry", TRO 2017, section VI.
        """
        part, noise, at = self._parts[k], self._noise, state.columns
        seconds = (part.t_ns - part.t_ns[0]) * 1e-9
        gained, faster, farther, by, covariance = preintegrate(
            seconds,
            part.gyro,
            part.accel,
            state.gyro_biases[k],
            state.accel_biases[k],
            state.gyro_matrix,
            state.accel_matrix,
            noise.gyro_noise,
            noise.accel_noise,
            INTEGRATION_VARIANCE,
        )
        h = float(seconds[-1])
        turn, later = state.poses[k, :3, :3], state.poses[k + 1, :3, :3]
        back = turn.T
        moved = back @ (
            state.poses[k + 1, :3, 3]
            - state.poses[k, :3, 3]
            - state.velocities[k] * h
            - 0.5 * self._gravity * h * h
        )
        sped = back @ (state.velocities[k + 1] - state.velocities[k] - self._gravity * h)
        residual = np.concatenate(
            [
                Rotation.from_matrix(gained.T @ back @ later).as_rotvec(),
                moved - farther,
                sped - faster,
                state.gyro_biases[k + 1] - state.gyro_biases[k],
                state.accel_biases[k + 1] - state.accel_biases[k],
            ]
        )
        J = np.zeros((15, 12 + 6 + 12 + 2 * len(UPPER)))
        J[0:3, 0:3], J[0:3, 6:9] = -later.T @ turn, np.eye(3)
        J[3:6, 0:3], J[3:6, 3:6], J[3:6, 9:12] = skew(moved), -np.eye(3), back @ later
        J[6:9, 0:3] = skew(sped)
        J[3:6, 12:15], J[6:9, 12:15], J[6:9, 15:18] = -back * h, -back, back
        J[0:9, 18:24] = -by[:, :6]
        J[9:15, 18:24], J[9:15, 24:30] = -np.eye(6), np.eye(6)
        J[0:9, 30:] = -by[:, 6:PARAMETERS]
        information = np.zeros((15, 15))
        information[:9, :9] = np.linalg.inv(covariance)
        walk = np.repeat([noise.gyro_walk, noise.accel_walk], 3) ** 2 * h
        information[range(9, 15), range(9, 15)] = 1.0 / walk
        columns = np.concatenate(
            [
                np.arange(6 * k, 6 * k + 12),
                np.arange(at.velocities + 3 * k, at.velocities + 3 * k + 6),
                np.arange(at.biases + 6 * k, at.biases + 6 * k + 12),
                np.arange(at.triangles, at.size),
            ]
        )
        return residual, J, columns, information

    def add(self, state: State, H: Array, g: Array) -> Array:
        """Add all intervals to H (P, P) and g (P,); returns chi^2 (K-1,) of each, of 15 components."""
        squares = np.empty(len(self._parts))
        for k in range(len(self._parts)):
            residual, J, columns, information = self.residual(state, k)
            weighted = information @ J
            H[np.ix_(columns, columns)] += J.T @ weighted
            g[columns] -= weighted.T @ residual
            squares[k] = residual @ information @ residual
        return squares
