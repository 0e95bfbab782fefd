"""Precision and recall by our own matching, in two semantics that detection tools report under one name.

``coco`` : within an image the surest detection takes the free label it overlaps most; precision is the
envelope at 101 recalls, read as a step. T.-Y. Lin et al., "Microsoft COCO", ECCV 2014.
``interpolated`` : the pair of largest overlap matches first, whatever its confidence; the envelope is
interpolated linearly between detections and integrated by trapezoids, as Ultralytics did up to 8.3.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.annotations.consistency.coco import MOST_DETECTIONS
from card.annotations.consistency.scene import IOU_THRESHOLDS, Array, Scene, overlaps

SEMANTICS = ("coco", "interpolated")
RECALLS: Array = np.linspace(0, 1, 101)


@dataclass(frozen=True)
class Matches:
    """Detections of one class, the surest first: (D,) confidence, (thresholds, D) hit; how many labels."""

    confidence: Array
    hit: NDArray[np.bool_]
    labels: int


def match(scene: Scene, name: int, semantics: str) -> Matches:
    """Match the detections of a class with its labels, image by image."""
    of_class = np.flatnonzero(scene.detected_class == name)
    labelled = scene.labelled[scene.labelled_class == name]
    images = scene.labelled_image[scene.labelled_class == name]
    chosen, hits = [], []
    for image in np.unique(scene.detected_image[of_class]):
        here = of_class[scene.detected_image[of_class] == image]
        here = here[np.argsort(-scene.confidence[here], kind="stable")][:MOST_DETECTIONS]
        iou = overlaps(scene.detected[here], labelled[images == image])
        matcher = _by_confidence if semantics == "coco" else _by_overlap
        chosen.append(here)
        hits.append(np.stack([matcher(iou, threshold) for threshold in IOU_THRESHOLDS]))
    if not chosen:
        return Matches(np.zeros(0), np.zeros((len(IOU_THRESHOLDS), 0), dtype=bool), len(labelled))
    confidence = scene.confidence[np.concatenate(chosen)]
    order = np.argsort(-confidence, kind="stable")
    return Matches(confidence[order], np.concatenate(hits, axis=1)[:, order], len(labelled))


def average_precision(matches: Matches, semantics: str) -> Array:
    """AP (thresholds,); NaN without labels."""
    if not matches.labels:
        return np.full(len(IOU_THRESHOLDS), np.nan)
    return np.array([_area(hit, matches.labels, semantics) for hit in matches.hit])


def _area(hit: NDArray[np.bool_], labels: int, semantics: str) -> float:
    if not hit.size:
        return 0.0
    recall = np.cumsum(hit) / labels
    precision = np.cumsum(hit) / np.arange(1, hit.size + 1)
    if semantics == "coco":
        envelope = np.maximum.accumulate(precision[::-1])[::-1]
        at = np.searchsorted(recall, RECALLS, side="left")
        return float(np.mean(np.append(envelope, 0.0)[at]))
    recall = np.concatenate([[0.0], recall, [1.0]])
    envelope = np.maximum.accumulate(np.concatenate([[1.0], precision, [0.0]])[::-1])[::-1]
    return float(np.trapezoid(np.interp(RECALLS, recall, envelope), RECALLS))


def _by_confidence(iou: Array, threshold: float) -> NDArray[np.bool_]:
    free = np.ones(iou.shape[1], dtype=bool)
    hit = np.zeros(iou.shape[0], dtype=bool)
    for row in range(iou.shape[0]):
        candidates = np.where(free, iou[row], -1.0)
        # Of equal ones the last, as COCO's evaluator does.
        best = iou.shape[1] - 1 - int(np.argmax(candidates[::-1])) if iou.shape[1] else -1
        if best >= 0 and candidates[best] >= threshold:
            free[best], hit[row] = False, True
    return hit


def _by_overlap(iou: Array, threshold: float) -> NDArray[np.bool_]:
    hit = np.zeros(iou.shape[0], dtype=bool)
    if not iou.size:
        return hit
    best = iou.argmax(axis=1)
    for label in range(iou.shape[1]):
        rows = np.flatnonzero((best == label) & (iou[:, label] >= threshold))
        if rows.size:
            hit[rows[np.argmax(iou[rows, label])]] = True
    return hit
