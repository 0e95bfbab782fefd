"""SE(3) as (4, 4) float64 matrices named ``a_from_b``; quaternions are (w, x, y, z) with w >= 0."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def matrix_from_quaternion(rotation_wxyz: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4); they are normalised first."""
    q = np.asarray(rotation_wxyz, dtype=np.float64)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(q, -1, 0)
    matrix = np.empty((*q.shape[:-1], 3, 3))
    matrix[..., 0, 0] = 1 - 2 * (y * y + z * z)
    matrix[..., 0, 1] = 2 * (x * y - w * z)
    matrix[..., 0, 2] = 2 * (x * z + w * y)
    matrix[..., 1, 0] = 2 * (x * y + w * z)
    matrix[..., 1, 1] = 1 - 2 * (x * x + z * z)
    matrix[..., 1, 2] = 2 * (y * z - w * x)
    matrix[..., 2, 0] = 2 * (x * z - w * y)
    matrix[..., 2, 1] = 2 * (y * z + w * x)
    matrix[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return matrix


def quaternion_from_matrix(rotation: ArrayLike) -> Array:
    """Unit quaternions (..., 4) with w >= 0 of rotation matrices (..., 3, 3)."""
    r = np.asarray(rotation, dtype=np.float64)
    diagonal = np.moveaxis(np.diagonal(r, axis1=-2, axis2=-1), -1, 0)
    trace = diagonal.sum(axis=0)
    # Each row is the quaternion times four times one of its own components; the largest is the stablest.
    candidates = np.empty((*r.shape[:-2], 4, 4))
    a, b, c = r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]
    d, e, f = r[..., 0, 1] + r[..., 1, 0], r[..., 0, 2] + r[..., 2, 0], r[..., 1, 2] + r[..., 2, 1]
    candidates[..., 0, :] = np.stack([1 + trace, a, b, c], axis=-1)
    candidates[..., 1, :] = np.stack([a, 1 + 2 * diagonal[0] - trace, d, e], axis=-1)
    candidates[..., 2, :] = np.stack([b, d, 1 + 2 * diagonal[1] - trace, f], axis=-1)
    candidates[..., 3, :] = np.stack([c, e, f, 1 + 2 * diagonal[2] - trace], axis=-1)
    best = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def transform(translation_m: ArrayLike, rotation_wxyz: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Array:
    """Transforms (..., 4, 4) of translations (..., 3) in metres and quaternions (..., 4)."""
    t = np.asarray(translation_m, dtype=np.float64)
    r = matrix_from_quaternion(rotation_wxyz)
    shape = np.broadcast_shapes(t.shape[:-1], r.shape[:-2])
    matrix = np.zeros((*shape, 4, 4))
    matrix[..., :3, :3] = r
    matrix[..., :3, 3] = t
    matrix[..., 3, 3] = 1.0
    return matrix


def inverse(a_from_b: ArrayLike) -> Array:
    """``b_from_a`` (..., 4, 4) of rigid transforms (..., 4, 4)."""
    matrix = np.asarray(a_from_b, dtype=np.float64)
    r_t = np.swapaxes(matrix[..., :3, :3], -1, -2)
    result = np.zeros_like(matrix)
    result[..., :3, :3] = r_t
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", r_t, matrix[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def apply(a_from_b: ArrayLike, points_b: ArrayLike) -> Array:
    """Points in frame ``a``: one (4, 4) for all points (N, 3), or one (N, 4, 4) for each point."""
    matrix = np.asarray(a_from_b, dtype=np.float64)
    points = np.asarray(points_b, dtype=np.float64)
    if matrix.ndim == 2:
        return points @ matrix[:3, :3].T + matrix[:3, 3]
    return np.einsum("...ij,...j->...i", matrix[..., :3, :3], points) + matrix[..., :3, 3]


def to_json(a_from_b: ArrayLike) -> dict[str, list[float]]:
    """The document form of one transform (4, 4): ``translation_m`` and ``rotation_wxyz``."""
    matrix = np.asarray(a_from_b, dtype=np.float64)
    return {
        "translation_m": [float(v) for v in matrix[:3, 3]],
        "rotation_wxyz": [float(v) for v in quaternion_from_matrix(matrix[:3, :3])],
    }


def from_json(document: Mapping[str, Any]) -> Array:
    """The transform (4, 4) of its document form."""
    translation: Sequence[float] = document["translation_m"]
    return transform(translation, document["rotation_wxyz"])
