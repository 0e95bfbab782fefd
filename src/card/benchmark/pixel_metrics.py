"""Depth and height errors as sums over pixels, and the metrics that follow from the sums.

Paper, supplement, 'Depth Evaluation' and 'Height Evaluation Metrics'; 'Depth Completion' for mae and imae.
This is the plain form; `card.benchmark.kernels` computes the same sums in one pass.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DELTA_BASE = 1.25
SUMS = (
    "truth", "valid", "pixels", "abs_rel", "sq_rel", "sq", "sq_log", "delta_1", "delta_2", "delta_3",
    "abs", "inv_abs", "inv_sq", "height_abs", "height_sq", "height_1", "height_2",
)  # fmt: skip
DEPTH_METRICS = ("abs_rel", "sq_rel", "rmse", "rmse_log", "delta_1", "delta_2", "delta_3")
COMPLETION_METRICS = ("rmse", "mae", "irmse", "imae", "abs_rel", "delta_1")
HEIGHT_METRICS = ("height_abs_diff", "height_rmse", "height_delta_1", "height_delta_2")
#: The sum each metric is the mean of, and whether the root is taken of it.
MEANS = {
    "abs_rel": ("abs_rel", False),
    "sq_rel": ("sq_rel", False),
    "rmse": ("sq", True),
    "rmse_log": ("sq_log", True),
    "delta_1": ("delta_1", False),
    "delta_2": ("delta_2", False),
    "delta_3": ("delta_3", False),
    "mae": ("abs", False),
    "irmse": ("inv_sq", True),
    "imae": ("inv_abs", False),
    "height_abs_diff": ("height_abs", False),
    "height_rmse": ("height_sq", True),
    "height_delta_1": ("height_1", False),
    "height_delta_2": ("height_2", False),
}
METRICS = tuple(MEANS)


def pixel_sums(
    truth: Array,
    prediction: Array,
    slope: Array,
    scales: Array,
    edges_m: Array,
    limits: tuple[float, float],
    thresholds_m: tuple[float, float],
    drop: bool,
) -> Array:
    """Sums (S, E + 1, len(SUMS)) of the errors over pixels, for each scale and each range of true depth.

    Parameters
    ----------
    truth, prediction : (M,) depth, metres; a prediction of 0 or NaN is none.
    slope : (M,) rise of the height over the road with depth along the pixel's ray; NaN without a road.
    scales : (S,) factors that the prediction is multiplied with.
    edges_m : (E,) true depths that part the pixels, increasing; none for one sum over all.
    limits : d_min and d_max, metres. thresholds_m : the two thresholds tau of the height accuracy.
    drop : False: every pixel counts, a prediction outside the limits is clipped to them. True: a pixel whose
        scaled prediction lies outside the limits does not count (the paper's valid set V).
    """
    near, far = limits
    part = np.searchsorted(edges_m, truth, side="right")
    out = np.zeros((len(scales), len(edges_m) + 1, len(SUMS)))
    for index, scale in enumerate(scales):
        p = np.nan_to_num(prediction * scale, nan=0.0)
        valid = (p >= near) & (p <= far)
        keep = valid if drop else np.ones(truth.shape, dtype=np.bool_)
        d, c, n = truth[keep], np.clip(p[keep], near, far), slope[keep]
        error = c - d
        inverse = 1 / c - 1 / d
        height = np.abs(error * n)
        terms = (
            np.ones_like(d),
            np.abs(error) / d,
            error**2 / d,
            error**2,
            np.log(c / d) ** 2,
            *((c < DELTA_BASE**k * d) & (d < DELTA_BASE**k * c) for k in (1, 2, 3)),
            np.abs(error),
            np.abs(inverse),
            inverse**2,
            height,
            height**2,
            # Without a road the share is as unknown as the height.
            *(np.where(np.isnan(height), np.nan, height < tau) for tau in thresholds_m),
        )
        for k, term in enumerate(terms, 2):
            out[index, :, k] = np.bincount(part[keep], weights=term, minlength=len(edges_m) + 1)
        for k, term in enumerate((np.ones_like(truth), valid)):
            out[index, :, k] = np.bincount(part, weights=term, minlength=len(edges_m) + 1)
    return out


def metrics_of(sums: Array) -> dict[str, Array]:
    """Metrics (...) of sums (..., len(SUMS)): NaN where no pixel counts, heights also where there is no road.

    abs_rel, rmse_log, delta_1..3, height_delta_1..2 [1]; sq_rel, rmse, mae, height_abs_diff, height_rmse [m];
    irmse and imae [1/m]. sq_rel is divided by d, not by its square; logarithms are natural.
    """
    column = {name: sums[..., k] for k, name in enumerate(SUMS)}
    pixels = np.where(column["pixels"] > 0, column["pixels"], np.nan)
    means = {name: (column[source] / pixels, root) for name, (source, root) in MEANS.items()}
    return {name: np.sqrt(mean) if root else mean for name, (mean, root) in means.items()}


def median_scale(truth: Array, prediction: Array) -> float:
    """Ratio of the medians of truth (M,) and prediction (M,), over pixels that have a prediction.

    1 where none has: there is nothing to scale.
    """
    given = prediction > 0
    if not given.any():
        return 1.0
    if given.all():
        return float(np.median(truth) / np.median(prediction))
    return float(np.median(truth[given]) / np.median(prediction[given]))
