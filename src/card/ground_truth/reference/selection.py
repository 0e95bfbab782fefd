"""The points of a frame's windows that visibility works on, in plain numpy (paper, supplement D)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.geometry import inverse
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.reference.mad import mad_inliers
from card.ground_truth.reference.static_cloud import StaticCloud, seen_by
from card.ground_truth.reference.thinning import pixels_covered, thin
from card.ground_truth.selection import Selection, diagonal
from card.ground_truth.static_set import StaticSet


def select(
    cloud: StaticCloud,
    keyframe_burst: int,
    world_from_rig: npt.NDArray[np.float64],
    static: StaticSet,
    camera: LeftCamera,
    settings: Mapping[str, Any],
) -> Selection:
    """Clean and crop; `StaticWindow.select` gives the same points in another order.

    Parameters
    ----------
    cloud : static points of the bursts in the frame's windows.
    keyframe_burst : ordinal of the keyframe burst, or -1.
    world_from_rig : (4, 4) at the image's time.
    """
    counts = {"points_window": cloud.total, "points_static": len(cloud.voxel)}
    matrix = inverse(world_from_rig @ camera.rig_from_camera)
    margin, nearest = settings["view_margin_rad"], settings["nearest_depth_m"]

    redundant = seen_by(cloud, len(static.keys)) >= settings["min_lidars_per_voxel"]
    counts["points_two_lidars"] = int(redundant[cloud.voxel].sum())
    # Cleaning looks at whole voxels, so voxels out of sight can go first without changing what is in sight.
    corners = _turned(matrix, static.grid.corners(static.keys)) + matrix[:3, 3]
    centres = corners + _turned(matrix, np.full((1, 3), static.grid.size / 2))
    radius = static.grid.size * np.sqrt(3) / 2
    wanted = redundant & camera.may_be_in_view(centres, radius, margin, nearest)
    kept = np.flatnonzero(wanted[cloud.voxel])
    counts["points_near_view"] = len(kept)
    clean = mad_inliers(
        cloud.voxel[kept],
        cloud.offset[kept],
        settings["mad_multiplier"],
        settings["mad_form"],
        settings["mad_min_inliers"],
    )
    kept = kept[clean]
    counts["points_clean"] = len(kept)
    inliers = kept
    if settings["points_per_voxel"]:
        kept = kept[thin(cloud.voxel[kept], np.full(len(corners), settings["points_per_voxel"]))]
    if settings["pixels_per_point"]:
        own, focal_px = cloud.voxel[inliers], (camera.undistorted.fx, camera.undistorted.fy)
        covered = pixels_covered(own, cloud.offset[inliers], corners, matrix[:3, :3], focal_px, nearest)
        limit = np.maximum((covered / settings["pixels_per_point"]).astype(np.int64), 1)
        # Front LiDAR first, each in order of time.
        kept = kept[np.argsort(~cloud.front[kept], kind="stable")]
        kept = kept[thin(cloud.voxel[kept], limit)]
    counts["points_thinned"] = len(kept)

    points = corners[cloud.voxel[kept]] + _turned(matrix, cloud.offset[kept].astype(np.float64))
    seen = camera.in_view(points, margin, nearest)
    points, kept = points[seen], kept[seen]
    counts["points_in_view"] = len(points)
    body = camera.on_ego(points)
    points, kept = points[~body], kept[~body]
    counts["points_not_ego"] = len(points)
    return Selection(points, cloud.burst[kept] == keyframe_burst, diagonal(corners[redundant]), counts)


def _turned(matrix: npt.NDArray[np.float64], points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Points (N, 3) turned by a transform; term by term, as no two matrix products round alike."""
    x, y, z = points.T
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix[:3, :3]], axis=1)
