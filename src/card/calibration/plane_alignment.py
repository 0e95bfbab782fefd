"""The pose between two sensors from planes that both see, in closed form."""

import numpy as np
from numpy.typing import NDArray

from card.geometry.rigid_alignment import rotation_between

Array = NDArray[np.float64]

_ROUNDS = 10
_FAR = 3.0  # times the median: views beyond it have no say


def align_planes(normals_a: Array, offsets_a: Array, normals_b: Array, offsets_b: Array) -> Array:
    """``a_from_b`` (4, 4) of planes normal @ point = offset: normals (V, 3), offsets (V,) in either frame.

    The rotation turns normals into normals (W. Kabsch, Acta Crystallographica A 32, 1976), then the
    translation follows from the offsets by linear least squares; views that fit far worse than the median one
    are left out.
    """
    keep = np.ones(len(normals_a), dtype=np.bool_)
    pose = np.eye(4)
    for _ in range(_ROUNDS):
        pose[:3, :3] = rotation_between(normals_a[keep], normals_b[keep])
        turned = normals_b @ pose[:3, :3].T
        pose[:3, 3] = np.linalg.lstsq(turned[keep], (offsets_a - offsets_b)[keep], rcond=None)[0]
        angle = np.linalg.norm(np.cross(normals_a, turned), axis=1)
        gap = np.abs(offsets_a - offsets_b - turned @ pose[:3, 3])
        now = (angle <= _FAR * np.median(angle[keep]) + 1e-9) & (gap <= _FAR * np.median(gap[keep]) + 1e-9)
        if (now == keep).all() or now.sum() < 3:
            break
        keep = now
    return pose
