"""Detections and labels of many images, as arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IOU_THRESHOLDS: Array = np.linspace(0.5, 0.95, 10)


@dataclass(frozen=True)
class Scene:
    """D detections and L labels in any number of images.

    detected, labelled : (D, 4), (L, 4) edges x_min, y_min, x_max, y_max in px.
    detected_image, labelled_image, detected_class, labelled_class : ordinals. confidence : (D,).
    """

    detected: Array
    detected_image: NDArray[np.int64]
    detected_class: NDArray[np.int64]
    confidence: Array
    labelled: Array
    labelled_image: NDArray[np.int64]
    labelled_class: NDArray[np.int64]


def overlaps(a: Array, b: Array) -> Array:
    """Intersection over union (A, B) of edges (A, 4) and (B, 4)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=2)
    areas = [np.prod(edges[:, 2:] - edges[:, :2], axis=1) for edges in (a, b)]
    return np.asarray(common / (areas[0][:, None] + areas[1][None] - common))
