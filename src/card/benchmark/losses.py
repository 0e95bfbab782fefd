"""Errors for training code: the definitions of the evaluation as plain functions of numpy arrays.

Each is written so that it reads the same in an autograd library: elementwise arithmetic, a mask and a mean.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.benchmark.pixel_metrics import median_scale
from card.geometry import CameraModel

Array = NDArray[np.float64]


def height_slope(camera: CameraModel, road_from_camera: ArrayLike) -> Array:
    """Rise (H, W) of the height over the road with depth along each pixel's ray, 1.

    A depth d is the height h = slope * d + road_from_camera[2, 3] over the frame's road plane. camera : the
    model of the image that depth is given for; road_from_camera : (4, 4), as `Release.road` has it.
    """
    v, u = np.mgrid[: camera.height, : camera.width]
    slope: Array = camera.rays(np.stack([u, v], axis=-1)) @ np.asarray(road_from_camera)[2, :3]
    return slope


def height_l1(prediction: ArrayLike, truth: ArrayLike, slope: ArrayLike) -> float:
    """L1 loss in height space, metres: mean of |h - h'| over the pixels that have a true depth.

    Equals the evaluation's height AbsDiff (paper, supplement, 'Height Evaluation Metrics') where no
    prediction needs clipping. Both depths are of the same pixels, so h - h' = slope * (d - d').

    Parameters
    ----------
    prediction, truth : (H, W) depth, metres; NaN or 0 in the truth is none.
    slope : (H, W) of `height_slope`.
    """
    d, given = _masked(truth)
    error = np.asarray(slope, dtype=np.float64)[given] * (np.asarray(prediction, dtype=np.float64)[given] - d)
    return float(np.mean(np.abs(error))) if error.size else float("nan")


def metric_l1(prediction: ArrayLike, truth: ArrayLike) -> float:
    """L1 loss in metric depth, metres: mean of |d - d'| over the pixels that have a true depth.

    prediction, truth : (H, W), metres; NaN or 0 in the truth is none. Equals the evaluation's MAE.
    """
    d, given = _masked(truth)
    error = np.asarray(prediction, dtype=np.float64)[given] - d
    return float(np.mean(np.abs(error))) if error.size else float("nan")


def to_metric(prediction: ArrayLike, truth: ArrayLike) -> Array:
    """A prediction (H, W) of unknown scale in metres: times the ratio of the medians of truth and prediction.

    The same median scaling as in the evaluation. truth : (H, W), metres; NaN or 0 is none.
    """
    d, given = _masked(truth)
    p = np.asarray(prediction, dtype=np.float64)
    return p * median_scale(d, p[given])


def _masked(truth: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    d = np.asarray(truth, dtype=np.float64)
    given = d > 0
    return d[given], given
