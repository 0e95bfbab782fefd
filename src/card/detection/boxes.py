"""Boxes that a detector finds, and what is left of those that overlap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Found:
    """One detection: class, confidence in 0..1, edges in px from the image's outer left and upper edges.

    They lie within the image. Where pixel centres are at integers, subtract half a pixel.
    """

    name: str
    confidence: float
    x_min: float
    y_min: float
    x_max: float
    y_max: float


def keep_best(
    edges: NDArray[np.float64], scores: NDArray[np.float64], classes: NDArray[np.int64], iou: float
) -> NDArray[np.int64]:
    """Indices, best first, of boxes (N, 4) that overlap no better one of their class by more than ``iou``."""
    import cv2

    if not len(edges):
        return np.empty(0, dtype=np.int64)
    # Equal scores keep the order they came in.
    order = np.argsort(-scores, kind="stable")
    sizes = edges[:, 2:] - edges[:, :2]
    rectangles = np.concatenate([edges[:, :2], sizes], axis=1)[order]
    kept = cv2.dnn.NMSBoxesBatched(
        rectangles.tolist(), scores[order].tolist(), classes[order].tolist(), 0.0, iou
    )
    return order[np.sort(np.asarray(kept, dtype=np.int64).ravel())]


def as_found(
    edges: NDArray[np.float64],
    scores: NDArray[np.float64],
    classes: NDArray[np.int64],
    names: Sequence[str],
) -> list[Found]:
    """Rows (N, 4), (N,), (N,) as objects in the same order."""
    rows = zip(classes.tolist(), scores.tolist(), edges.tolist(), strict=True)
    return [Found(names[number], score, *row) for number, score, row in rows]
