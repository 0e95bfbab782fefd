"""What visibility works on: the static points of a frame after cleaning and cropping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Selection:
    """points: (N, 3) camera_left, metres. of_keyframe: (N,) bool, from the keyframe's burst.

    diameter: D, metres: diagonal of the box round the corners of all voxels that enough LiDARs hit in the
    windows, axis-aligned in camera_left. It is good to a voxel and the same whatever is in view.
    counts: points left after each step, by the names of schema ``coverage``.
    """

    points: npt.NDArray[np.float64]
    of_keyframe: npt.NDArray[np.bool_]
    diameter: float
    counts: dict[str, int]


def diagonal(points: npt.NDArray[np.float64]) -> float:
    """Diagonal, metres, of the axis-aligned bounding box of points (N, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
