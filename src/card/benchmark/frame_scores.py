"""All scores of one frame: the full image, each box, each range of distance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.benchmark import pixel_metrics
from card.benchmark.boxes import box_span, inside
from card.benchmark.pixel_metrics import median_scale
from card.benchmark.truth import View, compiled

Array = NDArray[np.float64]
Pixels = NDArray[np.int64]

SCALINGS = ("none", "median")
INPUT_PIXELS = ("all", "without")


@dataclass(frozen=True)
class Evaluated:
    """The pixels of one frame that count, and what was predicted for them.

    pixels (M,) flat; truth, prediction (M,) metres; slope (M,) rise of height with depth, NaN without a road.
    """

    pixels: Pixels
    truth: Array
    prediction: Array
    slope: Array

    def part(self, chosen: Any) -> "Evaluated":
        """Some of the pixels, by a mask (M,) or their indices."""
        return Evaluated(self.pixels[chosen], self.truth[chosen], self.prediction[chosen], self.slope[chosen])


@dataclass(frozen=True)
class FrameScores:
    """Sums over pixels, `SUMS` in the last axis, for each scaling in the first.

    full (S, K); distances (S, D, K); boxes (S, B, K) and the median depth of each box, NaN for an empty one;
    scales (S,).
    """

    scales: Array
    full: Array
    distances: Array
    boxes: Array
    box_depth: Array


def evaluated_pixels(
    view: View,
    pixels: Pixels,
    truth: Array,
    prediction: Any,
    road_from_camera: Array | None,
    plain: bool = False,
) -> Evaluated:
    """What a prediction (H, W) in the original image says at the pixels (M,) that have truth (M,), metres.

    road_from_camera : (4, 4); Z is height over the road. None where the frame has no road plane. A height
    h = d (n . r) + offset changes with depth by its slope n . r alone.
    """
    kernels = None if plain else compiled()
    flat = np.ascontiguousarray(prediction).reshape(-1)
    if kernels is None:
        slope = slopes(view.rays[pixels], road_from_camera)
        return Evaluated(pixels, truth, flat[pixels].astype(np.float64), slope)
    return Evaluated(pixels, truth, *kernels.gather(pixels, flat, view.rays, road_normal(road_from_camera)))


def road_normal(road_from_camera: Array | None) -> Array:
    """Normal (3,) of the road in the camera's axes; NaN without a road."""
    return np.full(3, np.nan) if road_from_camera is None else road_from_camera[2, :3].copy()


def slopes(rays: Array, road_from_camera: Array | None) -> Array:
    """Rise (M,) of the height over the road with depth along rays (M, 2) with z = 1; NaN without a road."""
    n = road_normal(road_from_camera)
    rise: Array = rays[:, 0] * n[0] + rays[:, 1] * n[1] + n[2]
    return rise


def frame_scores(
    given: Evaluated,
    boxes: Sequence[Sequence[float]],
    size: tuple[int, int],
    scalings: Sequence[str],
    settings: Mapping[str, Any],
    plain: bool = False,
) -> FrameScores:
    """Scores of a frame's pixels; boxes : YOLO boxes, relative; size : width and height of the image.

    A box is scaled by the medians of its whole image.
    """
    limits = (settings["min_depth_m"], settings["max_depth_m"])
    thresholds = tuple(settings["height_thresholds_m"])
    drop = settings["profile"] == "paper"
    edges = np.array(settings["distance_edges_m"], dtype=np.float64)
    kernels = None if plain else compiled()
    sums = pixel_metrics.pixel_sums if kernels is None else kernels.pixel_sums
    median = median_scale if kernels is None else kernels.median_scale
    scales = np.array(
        [median(given.truth, given.prediction) if name == "median" else 1.0 for name in scalings]
    )

    def summed(e: Evaluated, edges_m: Array) -> Array:
        found: Array = sums(e.truth, e.prediction, e.slope, scales, edges_m, limits, thresholds, drop)
        return found

    distances = summed(given, edges)
    in_boxes = np.zeros((len(scales), len(boxes), distances.shape[-1]))
    box_depth = np.full(len(boxes), np.nan)
    for index, box in enumerate(boxes):
        part = given.part(inside(given.pixels, box_span(box, *size), size[0]))
        if part.truth.size:
            in_boxes[:, index] = summed(part, edges[:0])[:, 0]
            box_depth[index] = np.median(part.truth)
    return FrameScores(scales, distances.sum(axis=1), distances, in_boxes, box_depth)
