"""Height errors over the road plane of a frame (paper, supplement, 'Height Evaluation Metrics')."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel

Array = NDArray[np.float64]


@lru_cache(maxsize=1)
def pixel_rays(camera: CameraModel) -> Array:
    """Rays (H, W, 3) with z = 1 through all pixels of the original image."""
    v, u = np.mgrid[: camera.height, : camera.width]
    return camera.rays(np.stack([u, v], axis=-1))


def heights(depth: Array, rays: Array, road_from_camera: Array) -> Array:
    """Signed heights (M,) in metres over the road plane of depths (M,) along rays (M, 3) with z = 1.

    road_from_camera : (4, 4); the road frame's Z is the plane's normal, its origin lies on the plane.
    """
    normal, offset = road_from_camera[2, :3], road_from_camera[2, 3]
    return depth * (rays @ normal) + offset


def threshold_name(threshold_m: float) -> str:
    """Name of the share within a threshold in metres, e.g. ``delta_10cm``."""
    return f"delta_{100 * threshold_m:g}cm"


def height_metrics(truth: Array, prediction: Array, thresholds_m: Sequence[float]) -> Mapping[str, float]:
    """Errors of heights (M,) against true ones (M,), metres.

    ``height_abs_diff`` [m], ``height_rmse`` [m] and, for each threshold, the share [1] of pixels whose
    error is smaller. All are NaN where M is 0.
    """
    names = ["height_abs_diff", "height_rmse", *map(threshold_name, thresholds_m)]
    if truth.size == 0:
        return dict.fromkeys(names, float("nan"))
    error = np.abs(prediction - truth)
    values = [np.mean(error), np.sqrt(np.mean(error**2)), *(np.mean(error < t) for t in thresholds_m)]
    return dict(zip(names, map(float, values), strict=True))
