"""Depth errors of one image or one box (paper, supplement, 'Depth Evaluation')."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DELTA_BASE = 1.25
METRICS = ("abs_rel", "sq_rel", "rmse", "rmse_log", "delta_1", "delta_2", "delta_3", "valid_share")


def truth_mask(truth: Array, min_depth_m: float, max_depth_m: float) -> NDArray[np.bool_]:
    """Pixels (H, W) that are evaluated: those whose ground truth lies in the range.

    The prediction has no say, so that a method cannot improve by failing.
    """
    return (truth >= min_depth_m) & (truth <= max_depth_m)


def median_scale(truth: Array, prediction: Array) -> float:
    """Ratio of the medians of truth (M,) and prediction (M,), over pixels that have a prediction.

    1 where none has: there is nothing to scale.
    """
    given = prediction > 0
    if not given.any():
        return 1.0
    return float(np.median(truth[given]) / np.median(prediction[given]))


def clip_prediction(prediction: Array, min_depth_m: float, max_depth_m: float) -> Array:
    """The prediction within the range; a pixel without one (0 or NaN) counts as the nearest depth."""
    return np.clip(np.nan_to_num(prediction, nan=0.0), min_depth_m, max_depth_m)


def depth_metrics(
    truth: Array, prediction: Array, min_depth_m: float, max_depth_m: float
) -> Mapping[str, float]:
    """Errors of a prediction (M,) against the truth (M,), metres, over pixels of `truth_mask`.

    ``abs_rel`` [1], ``sq_rel`` [m] (divided by d, not by d^2), ``rmse`` [m], ``rmse_log`` [1] (natural
    logarithm), ``delta_1..3`` [1] (ratio below 1.25^n), and ``valid_share`` [1]: pixels whose prediction
    lies in the range before it is clipped. All are NaN where M is 0.
    """
    if truth.size == 0:
        return dict.fromkeys(METRICS, float("nan"))
    clipped = clip_prediction(prediction, min_depth_m, max_depth_m)
    error = clipped - truth
    ratio = np.maximum(truth / clipped, clipped / truth)
    values = (
        np.mean(np.abs(error) / truth),
        np.mean(error**2 / truth),
        np.sqrt(np.mean(error**2)),
        np.sqrt(np.mean(np.log(clipped / truth) ** 2)),
        *(np.mean(ratio < DELTA_BASE**n) for n in (1, 2, 3)),
        np.mean((prediction >= min_depth_m) & (prediction <= max_depth_m)),
    )
    return dict(zip(METRICS, map(float, values), strict=True))
