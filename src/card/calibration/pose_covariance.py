"""Covariances of poses that are chained, and of points that hang on a pose.

A pose a_from_b is disturbed in a: t + dt, exp(w) R; its covariance (6, 6) has dt before w.
"""

import numpy as np
from numpy.typing import NDArray

from card.calibration.corner_residuals import skew

Array = NDArray[np.float64]


def chained(a_from_b: Array, covariance: Array, b_from_c: Array, other: Array) -> Array:
    """Covariance (6, 6) of ``a_from_b @ b_from_c`` of two poses whose errors have nothing in common."""
    turn = a_from_b[:3, :3]
    first, second = np.eye(6), np.zeros((6, 6))
    first[:3, 3:] = -skew(turn @ b_from_c[:3, 3])
    second[:3, :3] = second[3:, 3:] = turn
    return _symmetric(first @ covariance @ first.T + second @ other @ second.T)


def of_points(a_from_b: Array, covariance: Array, points: Array, other: Array) -> Array:
    """Covariance (3 N, 3 N) of points (N, 3) of b with covariance ``other``, taken to a."""
    turned = points @ a_from_b[:3, :3].T
    by_pose = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -skew(turned)], axis=-1)
    by_pose = by_pose.reshape(-1, 6)
    turn = np.kron(np.eye(len(points)), a_from_b[:3, :3])
    return _symmetric(by_pose @ covariance @ by_pose.T + turn @ other @ turn.T)


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
