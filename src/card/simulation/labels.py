"""The labels a careful person would draw, from what each pixel really shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel
from card.simulation.irregularities import Irregularity
from card.simulation.road import Road
from card.simulation.traffic import Thing

Array = NDArray[np.float64]

CLASSES = ("positive", "negative")
_LABELLED = {"bump": "positive", "pothole": "negative"}
#: What is smaller than this nobody labels: visible pixels and a box's shorter side.
_FEWEST_PX, _SMALLEST_BOX_PX = 12, 3.0
_OUTLINE_STEPS = 25


@dataclass(frozen=True)
class Box:
    """A box in an original image, its edges in px (a pixel spans -0.5..0.5 about its centre).

    kind : positive, negative, face or plate.  thing : index of what it shows.  visible : its pixels in sight.
    share : of its silhouette within the image, 0 to 1, the share that is in sight, see `occlusion`.
    """

    kind: str
    thing: int
    x_min: float
    y_min: float
    x_max: float
    y_max: float
    visible: int
    share: float = 1.0


def private_boxes(seen: NDArray[np.int32], things: Sequence[Thing]) -> list[Box]:
    """Boxes around what is in sight of faces and plates in an image of thing indices (H, W)."""
    return _boxes(seen, {i: thing.kind for i, thing in enumerate(things) if thing.kind in ("face", "plate")})


def road_boxes(seen: NDArray[np.int32], road: Road) -> list[Box]:
    """Boxes around what is in sight of bumps and potholes in an image of thing indices (H, W)."""
    kinds = {i: _LABELLED[t.kind] for i, t in enumerate(road.irregularities) if t.kind in _LABELLED}
    return _boxes(seen, kinds)


def _boxes(seen: NDArray[np.int32], kinds: dict[int, str]) -> list[Box]:
    from scipy.ndimage import find_objects

    boxes = []
    for index, window in enumerate(find_objects(seen + 1)):
        if window is None or index not in kinds:
            continue
        rows, columns = window
        box = Box(
            kinds[index],
            index,
            columns.start - 0.5,
            rows.start - 0.5,
            columns.stop - 0.5,
            rows.stop - 0.5,
            int(np.count_nonzero(seen[window] == index)),
        )
        if _worth_labelling(box):
            boxes.append(box)
    return boxes


def outline(road: Road, thing: Irregularity) -> Array:
    """World points (N, 3) of an irregularity's surface."""
    s_min, s_max, d_min, d_max = thing.extent
    s, d = np.meshgrid(
        np.linspace(s_min, s_max, _OUTLINE_STEPS),
        np.linspace(d_min, d_max, 4 * _OUTLINE_STEPS),
        indexing="ij",
    )
    raised = np.abs(thing.height(s, d)) > 1e-4
    return road.xyz(s[raised], d[raised])


def yolo_lines(boxes: Sequence[Box], camera: CameraModel) -> list[str]:
    """Lines ``class x_center y_center width height`` of a YOLO file, in shares of the image."""
    lines = []
    for box in boxes:
        x, y = (box.x_min + box.x_max) / 2 + 0.5, (box.y_min + box.y_max) / 2 + 0.5
        values = (
            x / camera.width,
            y / camera.height,
            (box.x_max - box.x_min) / camera.width,
            (box.y_max - box.y_min) / camera.height,
        )
        lines.append(" ".join([str(CLASSES.index(box.kind)), *(f"{v:.6f}" for v in values)]))
    return lines


def _worth_labelling(box: Box) -> bool:
    smaller = min(box.x_max - box.x_min, box.y_max - box.y_min)
    return box.visible >= _FEWEST_PX and smaller >= _SMALLEST_BOX_PX
