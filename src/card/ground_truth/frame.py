"""The ground truth of one frame (paper, supplement D and E)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.geometry import apply, inverse
from card.ground_truth.hidden_points import two_pass_visibility
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.selection import Selection

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
    """points: (N, 3) float32, camera_left, metres, in raster order. counts: by STEPS. pixels: hit."""

    points: npt.NDArray[np.float32]
    pixels: int
    counts: dict[str, int]
    rejected: int


def build_frame(
    selection: Selection,
    keyframe: npt.NDArray[np.float64],
    world_from_rig: npt.NDArray[np.float64],
    camera: LeftCamera,
    settings: Mapping[str, Any],
    workspace: Workspace,
    consistent: Callable[[npt.NDArray[np.float64], npt.NDArray[np.float64]], npt.NDArray[np.bool_]]
    | None = None,
) -> Frame:
    """Reduce the selected points and the keyframe to what the left camera sees.

    Parameters
    ----------
    keyframe : (K, 3) world, metres: all points of the keyframe burst.
    world_from_rig : (4, 4) at the image's time.
    consistent : which visible points (N, 3) stay beside the keyframe (K, 3); see `consensus`.
    """
    margin, nearest = settings["view_margin_rad"], settings["nearest_depth_m"]
    key = apply(inverse(world_from_rig @ camera.rig_from_camera), keyframe)
    key = key[camera.in_view(key, margin, nearest)]
    key = key[~camera.on_ego(key)]
    points = selection.points
    first, second, of_key = two_pass_visibility(
        points, selection.of_keyframe, key, selection.diameter, settings, workspace
    )
    visible = np.concatenate([np.take(points, second, axis=0), key[of_key]])

    step = settings["resolution_m"]
    visible = np.rint(visible / step) * step
    rejected = 0
    if consistent is not None:
        stays = consistent(visible, key)
        rejected = int((~stays).sum())
        visible = visible[stays]
    on_image, pixels = camera.raster(visible)
    counts = {
        **selection.counts,
        "points_pass_1": len(first),
        "points_keyframe": len(key),
        "points_pass_2": len(visible) + rejected,
        "points_saved": len(on_image),
    }
    pixel = pixels[:, 1] * camera.image.width + pixels[:, 0]
    different = int(np.count_nonzero(pixel[1:] != pixel[:-1])) + min(len(pixel), 1)
    ordered = {name: counts[name] for name in STEPS}
    saved = np.take(visible, on_image, axis=0).astype(np.float32)
    return Frame(saved, different, ordered, rejected)
