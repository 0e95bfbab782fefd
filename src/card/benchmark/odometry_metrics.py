"""Errors of a trajectory against the true one: absolute, relative, and KITTI's drift over segments.

ATE, RPE: J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012. Drift: A. Geiger
et al., "Are we ready for Autonomous Driving? The KITTI Vision Benchmark Suite", CVPR 2012.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from card.geometry import inverse

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: KITTI starts a segment at every tenth frame.
SEGMENT_STEP = 10


def align(truth: Array, estimate: Array, with_scale: bool) -> tuple[float, Array, Array]:
    """Scale s, rotation R (3, 3) and translation t (3,) that bring positions (N, 3) to true ones: s R x + t.

    S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991.
    """
    mean_t, mean_e = truth.mean(axis=0), estimate.mean(axis=0)
    u, singular, vt = np.linalg.svd((truth - mean_t).T @ (estimate - mean_e) / len(truth))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt)) or 1.0])
    rotation: Array = u @ np.diag(signs) @ vt
    spread = np.mean(np.sum((estimate - mean_e) ** 2, axis=1))
    scale = float(singular @ signs / spread) if with_scale and spread > 0 else 1.0
    return scale, rotation, mean_t - scale * rotation @ mean_e


def absolute_error(truth: Array, estimate: Array, with_scale: bool) -> tuple[float, float]:
    """Root mean square of the position errors (m) of poses (N, 4, 4) after alignment, and its scale."""
    positions = truth[:, :3, 3], estimate[:, :3, 3]
    scale, rotation, translation = align(*positions, with_scale)
    error = positions[0] - (scale * positions[1] @ rotation.T + translation)
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1)))), scale


def relative_errors(truth: Array, estimate: Array, first: Indices, last: Indices) -> tuple[Array, Array]:
    """Translation (m) and rotation (rad) errors (K,) of the motion from poses ``first`` to ``last`` (K,)."""
    motions = [_inverse(poses[first]) @ poses[last] for poses in (truth, estimate)]
    error = _inverse(motions[1]) @ motions[0]
    return np.linalg.norm(error[:, :3, 3], axis=1), _angle(error[:, :3, :3])


def segments(truth: Array, lengths_m: Sequence[float]) -> tuple[Indices, Indices, Array]:
    """First and last pose (K,) and length (K,) in metres of KITTI's segments along the true path."""
    travelled = path_lengths(truth)
    first, last, length = [], [], []
    for start in range(0, len(truth), SEGMENT_STEP):
        for metres in lengths_m:
            end = int(np.searchsorted(travelled, travelled[start] + metres, side="right"))
            if end < len(truth):
                first.append(start)
                last.append(end)
                length.append(metres)
    return np.array(first, dtype=np.int64), np.array(last, dtype=np.int64), np.array(length, dtype=np.float64)


def path_lengths(poses: Array) -> Array:
    """Length of the path up to each pose (N,), metres."""
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _inverse(poses: Array) -> Array:
    return np.array([inverse(pose) for pose in poses]).reshape(-1, 4, 4)


def _angle(rotations: Array) -> Array:
    """Angles (K,) in rad; from sine and cosine, so that small ones are exact."""
    skew = rotations - np.swapaxes(rotations, 1, 2)
    sine = np.sqrt(skew[:, 2, 1] ** 2 + skew[:, 0, 2] ** 2 + skew[:, 1, 0] ** 2)
    angles: Array = np.arctan2(sine, np.trace(rotations, axis1=1, axis2=2) - 1)
    return angles
