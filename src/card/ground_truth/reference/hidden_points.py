"""Hidden-point removal as published, by Open3D: what the fast path is measured against."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from card.artifacts.open3d import import_open3d

MIN_HULL_POINTS = 4
_SAMPLE = 1000


def spans_space(points: npt.NDArray[np.float64]) -> bool:
    """Whether points (N, 3) and the viewer at the origin span a hull: four, not in one plane with it."""
    if len(points) < MIN_HULL_POINTS:
        return False
    sample = points[:: max(1, len(points) // _SAMPLE)]
    return any(np.linalg.matrix_rank(some.T @ some) == 3 for some in (sample, points))


def visible_by_hull(points: npt.NDArray[np.float64], radius: float) -> npt.NDArray[np.int64]:
    """Increasing indices of the points (N, 3), metres, that a viewer at the origin sees.

    They are the vertices of the convex hull of the cloud flipped in a sphere of `radius` (m) and the viewer.
    Of exact duplicates one is returned. If the points span no hull nothing can be said to hide another.
    """
    if not spans_space(points):
        return np.arange(len(points))
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    _, visible = cloud.hidden_point_removal(np.zeros(3), radius)
    return np.unique(np.asarray(visible, dtype=np.int64))
