"""Hidden-point removal (Katz et al. 2007) in two passes (paper, supplement E)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts.open3d import import_open3d
from card.errors import CardError

Points = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

MIN_HULL_POINTS = 4


def diagonal(points: Points) -> float:
    """D: diagonal, metres, of the axis-aligned bounding box of points (N, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def visible_points(points: Points, radius: float) -> Index:
    """Increasing indices of the points (N, 3), metres, that a viewer at the origin sees.

    They are the vertices of the convex hull of the cloud flipped in a sphere of `radius` (m) and the viewer.
    Of exact duplicates one is returned. CardError if a point is as far as the radius: the flip of a point
    beyond the sphere says nothing.
    """
    # Points in one plane with the viewer span no hull: nothing can be said to hide another.
    if len(points) < MIN_HULL_POINTS or np.linalg.matrix_rank(points.T @ points) < 3:
        return np.arange(len(points))
    farthest = float(np.linalg.norm(points, axis=1).max())
    if farthest >= radius:
        raise CardError(
            "cloud is too far away for hidden-point removal",
            found=f"a point at {farthest:.1f} m",
            wanted=f"less than the radius of {radius:.1f} m",
        )
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    _, visible = cloud.hidden_point_removal(np.zeros(3), radius)
    return np.unique(np.asarray(visible, dtype=np.int64))


def two_pass_visibility(
    static: Points,
    is_keyframe: npt.NDArray[np.bool_],
    keyframe: Points,
    diameter: float,
    settings: Mapping[str, Any],
) -> tuple[Index, Index, Index]:
    """What is seen of the static cloud (N, 3) and of the keyframe (K, 3), camera frame, metres.

    Pass 1 tests the static cloud at R = hpr_first D. Pass 2 tests its survivors together with the whole
    keyframe at R = hpr_second D. `diameter` is D, metres: the diagonal of the frame's whole static cloud,
    not of what is left of it in view. A static point that belongs to the keyframe's burst (`is_keyframe`,
    (N,)) enters pass 2 only as a keyframe point.

    Returns
    -------
    Indices into `static` after pass 1, into `static` after pass 2, into `keyframe` after pass 2.
    """
    D = diameter
    everything = np.concatenate([static, keyframe])
    if len(everything) and np.linalg.norm(everything, axis=1).max() >= settings["hpr_first"] * D:
        # At a sequence's end hardly anything may be static; then the keyframe and the viewer count too.
        D = diagonal(np.concatenate([everything, np.zeros((1, 3))]))
    first = visible_points(static, settings["hpr_first"] * D)
    again = first[~is_keyframe[first]]
    both = np.concatenate([static[again], keyframe])
    second = visible_points(both, settings["hpr_second"] * D)
    return first, again[second[second < len(again)]], second[second >= len(again)] - len(again)
