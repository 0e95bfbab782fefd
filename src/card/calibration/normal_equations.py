"""Normal equations of residuals that share some unknowns over all views and have a pose in each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.calibration.residuals import Linear

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Normal:
    """Curvature and gradient of half the sum of squares.

    shared : (S, S) and gradient (S,) of the shared unknowns.
    cross : (V, S, 6) between them and the poses.
    pose : (V, 6, 6) and pose_gradient (V, 6) of the poses.
    """

    shared: Array
    gradient: Array
    cross: Array
    pose: Array
    pose_gradient: Array


def normal_of(linear: Linear, columns: NDArray[np.intp], weight: Array, size: int) -> Normal:
    """Normal equations of one block with weights (V, M), its columns set among ``size`` shared unknowns."""
    root = np.sqrt(weight)
    absent = root == 0
    residual = np.where(absent, 0.0, linear.residual * root)
    jacobian = np.concatenate([linear.shared, linear.pose], axis=-1) * root[..., None]
    jacobian[absent] = 0.0
    transposed = np.swapaxes(jacobian, 1, 2)
    curvature = transposed @ jacobian
    gradient = (transposed @ residual[..., None])[..., 0]
    own, views = len(columns), len(residual)
    shared, cross = np.zeros((size, size)), np.zeros((views, size, 6))
    shared[np.ix_(columns, columns)] = curvature[:, :own, :own].sum(axis=0)
    cross[:, columns] = curvature[:, :own, own:]
    return Normal(
        shared,
        scattered(gradient[:, :own].sum(axis=0), columns, size),
        cross,
        curvature[:, own:, own:],
        gradient[:, own:],
    )


def add(parts: Sequence[Normal]) -> Normal:
    """The sum of normal equations over the same views."""
    names = ("shared", "gradient", "cross", "pose", "pose_gradient")
    return Normal(*(np.sum([getattr(part, name) for part in parts], axis=0) for name in names))


def reduced(normal: Normal, free: NDArray[np.intp], damping: float) -> tuple[Array, Array, float]:
    """Damped step of the free shared unknowns (F,), of the poses (V, 6), and what it should gain.

    The poses are eliminated first (Schur complement), then found again.
    """
    pose = normal.pose + damping * np.eye(6) * normal.pose
    cross = normal.cross[:, free]
    swept = cross @ np.linalg.inv(pose)  # (V, F, 6)
    shared = normal.shared[np.ix_(free, free)]
    shared = shared + damping * np.diag(np.diag(shared))
    across = np.swapaxes(swept, 0, 1).reshape(len(free), -1)
    shared = shared - across @ np.swapaxes(cross, 0, 1).reshape(len(free), -1).T
    gradient = normal.gradient[free] - np.einsum("vsi,vi->s", swept, normal.pose_gradient)
    scale = 1 / np.sqrt(np.maximum(np.diag(shared), 1e-300))
    step = -scale * np.linalg.solve(shared * np.outer(scale, scale), scale * gradient)
    back = normal.pose_gradient + np.einsum("vsi,s->vi", cross, step)
    poses = -np.linalg.solve(pose, back[..., None])[..., 0]
    gain = -float(normal.gradient[free] @ step + np.sum(normal.pose_gradient * poses)) / 2
    return step, poses, gain


def scattered(values: Array, columns: NDArray[np.intp], size: int) -> Array:
    """Values at columns of a vector of zeros."""
    whole = np.zeros(size)
    whole[columns] = values
    return whole
