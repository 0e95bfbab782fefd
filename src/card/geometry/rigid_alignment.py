"""The rigid transform between two sets of points, in closed form."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotation_between(vectors_a: Array, vectors_b: Array) -> Array:
    """The rotation (3, 3) that turns vectors (N, 3) of frame b into those of frame a best; see `align`."""
    u, _, vt = np.linalg.svd(vectors_a.T @ vectors_b)
    mirrored = np.sign(np.linalg.det(u @ vt))
    rotation: Array = u @ np.diag([1.0, 1.0, mirrored]) @ vt
    return rotation


def align(points_a: Array, points_b: Array) -> Array:
    """``a_from_b`` (4, 4) with the least sum of squared distances between points (N, 3) of both frames.

    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Crystallographica A32,
    1976. Flat sets of points will do; sets on a line leave the turn about it open.
    """
    middle_a, middle_b = points_a.mean(axis=0), points_b.mean(axis=0)
    a_from_b = np.eye(4)
    a_from_b[:3, :3] = rotation_between(points_a - middle_a, points_b - middle_b)
    a_from_b[:3, 3] = middle_a - a_from_b[:3, :3] @ middle_b
    return a_from_b


def misfit(points_a: Array, points_b: Array) -> Array:
    """Distances (N,) between points that remain after `align`."""
    a_from_b = align(points_a, points_b)
    return np.asarray(np.linalg.norm(points_b @ a_from_b[:3, :3].T + a_from_b[:3, 3] - points_a, axis=1))
