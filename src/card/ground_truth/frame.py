"""The ground truth of one frame (paper, supplement D and E)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.geometry import apply, inverse
from card.ground_truth.hidden_points import diagonal, two_pass_visibility
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.mad import mad_inliers
from card.ground_truth.static_set import StaticSet
from card.ground_truth.static_window import StaticCloud, seen_by
from card.ground_truth.thinning import thin

#: The steps in order, and what is left after each; names of counts in coverage and report.
STEPS = (
    "points_window",
    "points_static",
    "points_two_lidars",
    "points_near_view",
    "points_clean",
    "points_thinned",
    "points_in_view",
    "points_not_ego",
    "points_pass_1",
    "points_keyframe",
    "points_pass_2",
    "points_saved",
)


@dataclass(frozen=True)
class Frame:
    """points: (N, 3) float32, camera_left, metres, in raster order. counts: by STEPS. pixels: (N, 2)."""

    points: npt.NDArray[np.float32]
    pixels: npt.NDArray[np.int64]
    counts: dict[str, int]


def build_frame(
    cloud: StaticCloud,
    keyframe: npt.NDArray[np.float64],
    keyframe_burst: int,
    world_from_rig: npt.NDArray[np.float64],
    static: StaticSet,
    camera: LeftCamera,
    settings: Mapping[str, Any],
) -> Frame:
    """Clean, project and reduce to what the left camera sees.

    Parameters
    ----------
    cloud : static points of the bursts in the frame's windows.
    keyframe : (K, 3) world, metres: all points of the keyframe burst. keyframe_burst: its ordinal, or -1.
    world_from_rig : (4, 4) at the image's time.
    """
    counts = {"points_window": cloud.total, "points_static": len(cloud.voxel)}
    camera_from_world = inverse(world_from_rig @ camera.rig_from_camera)
    margin, nearest = settings["view_margin_rad"], settings["nearest_depth_m"]

    redundant = seen_by(cloud, len(static.keys)) >= settings["min_lidars_per_voxel"]
    counts["points_two_lidars"] = int(redundant[cloud.voxel].sum())
    # Cleaning looks at whole voxels, so voxels out of sight can go first without changing what is in sight.
    corners = apply(camera_from_world, static.grid.corners(static.keys))
    half = camera_from_world[:3, :3] @ np.full(3, static.grid.size / 2)
    radius = static.grid.size * np.sqrt(3) / 2
    wanted = redundant & camera.may_be_in_view(corners + half, radius, margin, nearest)
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
    kept = kept[thin(cloud.voxel[kept], settings["points_per_voxel"])]
    counts["points_thinned"] = len(kept)

    points = corners[cloud.voxel[kept]] + cloud.offset[kept] @ camera_from_world[:3, :3].T
    seen = camera.in_view(points, margin, nearest)
    points, kept = points[seen], kept[seen]
    counts["points_in_view"] = len(points)
    body = camera.on_ego(points)
    points, kept = points[~body], kept[~body]
    counts["points_not_ego"] = len(points)

    key = apply(camera_from_world, keyframe)
    key = key[camera.in_view(key, margin, nearest)]
    key = key[~camera.on_ego(key)]
    counts["points_keyframe"] = len(key)
    # Good to a voxel, and the same whatever the view keeps of the cloud.
    diameter = diagonal(corners[redundant])
    of_burst = cloud.burst[kept] == keyframe_burst
    first, second, of_key = two_pass_visibility(points, of_burst, key, diameter, settings)
    counts |= {"points_pass_1": len(first), "points_pass_2": len(second) + len(of_key)}
    visible = np.concatenate([points[second], key[of_key]])

    step = settings["resolution_m"]
    visible = np.rint(visible / step) * step
    on_image, pixels = camera.raster(visible)
    counts["points_saved"] = len(on_image)
    return Frame(visible[on_image].astype(np.float32), pixels, {name: counts[name] for name in STEPS})
