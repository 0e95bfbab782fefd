"""What the pictures of an evaluation show: depth and height of truth and predictions in a crop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.benchmark.boxes import box_span
from card.benchmark.frame_scores import slopes
from card.benchmark.frames import Loaded, SequenceView, evaluated
from card.benchmark.pixel_metrics import median_scale

Array = NDArray[np.float64]
Span = tuple[slice, slice]

#: How far the crop round a box reaches over it, in its own size, and at least, in pixels.
MARGIN, LEAST_MARGIN_PX = 0.6, 12


@dataclass(frozen=True)
class Maps:
    """Depth (h, w) and height (h, w) in metres of a part of the original image; NaN for none."""

    depth: Array
    height: Array


def crop_of(box: Sequence[float], width: int, height: int) -> Span:
    """Rows and columns round a YOLO box."""
    rows, columns = box_span(box, width, height)
    spans = []
    for span, size in ((rows, height), (columns, width)):
        reach = max(LEAST_MARGIN_PX, int(MARGIN * (span.stop - span.start)))
        spans.append(slice(max(0, span.start - reach), min(size, span.stop + reach)))
    return spans[0], spans[1]


def truth_maps(frame: Loaded, view: SequenceView, span: Span, settings: Mapping[str, Any]) -> Maps:
    """Depth and height of the ground truth."""
    camera = view.view.camera
    pixels, truth = view.view.truth(frame.points, (settings["min_depth_m"], settings["max_depth_m"]))
    depth = np.full(camera.width * camera.height, np.nan)
    depth[pixels] = truth
    cut = depth.reshape(camera.height, camera.width)[span]
    return Maps(cut, _height(cut, frame, view, span))


def predicted_maps(
    frame: Loaded, view: SequenceView, span: Span, settings: Mapping[str, Any], scaled: bool
) -> Maps:
    """Depth and height of a prediction; scaled : to the truth's median in the whole image."""
    given, _ = evaluated(frame, view, settings)
    scale = median_scale(given.truth, given.prediction) if scaled else 1.0
    if view.space.name == "original":
        depth = np.array(frame.prediction[span], dtype=np.float64)
    else:
        rays = view.view.rays.reshape(view.view.camera.height, view.view.camera.width, 2)[span]
        depth = view.space.sample(frame.prediction, rays.reshape(-1, 2))[0].reshape(rays.shape[:2])
    depth = np.where(depth > 0, depth * scale, np.nan)
    return Maps(depth, _height(depth, frame, view, span))


def largest_boxes(boxes: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """For each class the box (row of `evaluation_boxes`) with the most truth on a frame with a road."""
    found: dict[str, Mapping[str, Any]] = {}
    for row in boxes:
        if (
            row["height_abs_diff"] is not None
            and row["pixels"] > found.get(row["class"], {"pixels": 0})["pixels"]
        ):
            found[row["class"]] = row
    return found


def _height(depth: Array, frame: Loaded, view: SequenceView, span: Span) -> Array:
    camera = view.view.camera
    rays = view.view.rays.reshape(camera.height, camera.width, 2)[span].reshape(-1, 2)
    road = frame.road_from_camera
    if road is None:
        return np.full(depth.shape, np.nan)
    height: Array = depth * slopes(rays, road).reshape(depth.shape) + road[2, 3]
    return height
