"""Preintegration with its derivatives by biases, scale factors and misalignments, compiled."""

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Entries of an upper triangular (3, 3), row by row.
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_ROWS = np.array([i for i, _ in UPPER])
_COLUMNS = np.array([j for _, j in UPPER])
#: Parameters of an interval: gyro and accelerometer bias, upper triangles of gyro and accelerometer.
PARAMETERS = 18


@numba.njit(cache=True)
def skew(v: Array) -> Array:
    """The matrix (3, 3) of the cross product by v (3,)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@numba.njit(cache=True)
def exp_rotation(v: Array) -> Array:
    """The rotation (3, 3) of a rotation vector (3,)."""
    angle = np.sqrt(v @ v)
    K = skew(v)
    if angle < 1e-8:
        return np.eye(3) + K + 0.5 * K @ K
    return np.eye(3) + np.sin(angle) / angle * K + (1.0 - np.cos(angle)) / angle**2 * K @ K


@numba.njit(cache=True)
def preintegrate(
    seconds: Array, gyro: Array, accel: Array, gyro_bias: Array, accel_bias: Array,
    gyro_matrix: Array, accel_matrix: Array, gyro_noise: float, accel_noise: float, integration: float,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Rotation (3, 3), velocity and position (3,) gained over samples at `seconds` (N,), gravity apart.

    Rate and force are matrix @ measured - bias. Also: derivatives (9, PARAMETERS) of rotation, position and
    velocity by biases and upper triangles, and their covariance (9, 9), from noise densities and the variance
    `integration` a second of each position and velocity. C. Forster et al., "On-Manifold Preintegration for
    Real-Time Visual-Inertial Odometry", TRO 2017, with the force turned by the attitude in mid-step.
    """
    R, v, p = np.eye(3), np.zeros(3), np.zeros(3)
    S, C = np.zeros((9, PARAMETERS)), np.zeros((9, 9))
    for k in range(len(seconds) - 1):
        dt = seconds[k + 1] - seconds[k]
        if dt <= 0:
            continue
        rate, force = 0.5 * (gyro[k] + gyro[k + 1]), 0.5 * (accel[k] + accel[k + 1])
        turn = exp_rotation((gyro_matrix @ rate - gyro_bias) * dt)
        middle = R @ exp_rotation(0.5 * dt * (gyro_matrix @ rate - gyro_bias))
        gained = accel_matrix @ force - accel_bias
        step = middle @ gained
        # By rate (3) and force (3) in this step; half of a rate's error turns the force.
        B = np.zeros((9, 6))
        B[0:3, 0:3] = np.eye(3) * dt
        B[6:9, 0:3] = -middle @ skew(gained) * (0.5 * dt * dt)
        B[6:9, 3:6] = middle * dt
        B[3:6] = 0.5 * dt * B[6:9]
        A = np.eye(9)
        A[0:3, 0:3] = turn.T
        A[6:9, 0:3] = -middle @ skew(gained) @ exp_rotation(-0.5 * dt * (gyro_matrix @ rate - gyro_bias)) * dt
        A[3:6, 0:3] = 0.5 * dt * A[6:9, 0:3]
        A[3:6, 6:9] = np.eye(3) * dt
        by = np.zeros((6, PARAMETERS))
        for i in range(6):
            by[i, i] = -1.0
        for u in range(6):
            by[_ROWS[u], 6 + u] = rate[_COLUMNS[u]]
            by[3 + _ROWS[u], 12 + u] = force[_COLUMNS[u]]
        S = A @ S + B @ by
        Q = np.zeros((6, 6))
        for i in range(3):
            Q[i, i], Q[3 + i, 3 + i] = gyro_noise**2 / dt, accel_noise**2 / dt
        C = A @ C @ A.T + B @ Q @ B.T
        for i in range(3, 9):
            C[i, i] += integration * dt
        p = p + v * dt + 0.5 * step * dt * dt
        v = v + step * dt
        R = R @ turn
    return R, v, p, S, C
