"""All scores of one frame: full image and boxes, as predicted and scaled to the truth's median."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.benchmark.boxes import box_mask
from card.benchmark.depth_metrics import clip_prediction, depth_metrics, median_scale, truth_mask
from card.benchmark.height_metrics import height_metrics, heights, pixel_rays
from card.geometry import CameraModel

Array = NDArray[np.float64]

REGIONS = ("full", "boxes")
SCALINGS = ("none", "median")


@dataclass(frozen=True)
class Score:
    """Metrics of the full image or of one box: NaN where no pixel counts, heights NaN without a road."""

    region: str
    scaling: str
    pixels: int
    metrics: Mapping[str, float]


def frame_scores(
    truth: Array,
    prediction: Array,
    camera: CameraModel,
    road_from_camera: Array | None,
    boxes: Sequence[Sequence[float]],
    settings: Mapping[str, Any],
) -> list[Score]:
    """Scores of a prediction (H, W) against the truth (H, W), metres; NaN is no truth.

    road_from_camera : (4, 4), or None where the frame has no road plane. boxes : YOLO boxes, relative.
    A box is scaled by the median of its whole image.
    """
    limits = settings["min_depth_m"], settings["max_depth_m"]
    mask = truth_mask(truth, *limits)
    d, predicted = truth[mask], prediction[mask]
    rays = pixel_rays(camera)[mask]
    regions = [("full", np.ones(d.size, dtype=np.bool_))]
    regions += [("boxes", box_mask(box, camera.width, camera.height)[mask]) for box in boxes]

    scores = []
    for scaling in SCALINGS:
        p = predicted * (median_scale(d, predicted) if scaling == "median" else 1.0)
        for region, inside in regions:
            depth = depth_metrics(d[inside], p[inside], *limits)
            # Without a road plane there are no heights, as over no pixels.
            over = inside if road_from_camera is not None else np.zeros_like(inside)
            road = np.eye(4) if road_from_camera is None else road_from_camera
            h_true = heights(d[over], rays[over], road)
            h = heights(clip_prediction(p[over], *limits), rays[over], road)
            height = height_metrics(h_true, h, settings["height_thresholds_m"])
            scores.append(Score(region, scaling, int(inside.sum()), {**depth, **height}))
    return scores
