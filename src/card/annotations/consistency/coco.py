"""Average precision in COCO's semantics, by COCO's own evaluator."""

import contextlib
import io

import numpy as np
from numpy.typing import NDArray

from card.annotations.consistency.scene import IOU_THRESHOLDS, Scene

MOST_DETECTIONS = 100


def coco_precision(scene: Scene, classes: int) -> NDArray[np.float64]:
    """AP (classes, thresholds) at each IoU threshold from 0.50 to 0.95; NaN for a class without labels."""
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    if not len(scene.labelled):
        return np.full((classes, len(IOU_THRESHOLDS)), np.nan)
    images = np.unique(np.concatenate([scene.detected_image, scene.labelled_image])).tolist()
    truth = COCO()
    truth.dataset = {
        "images": [{"id": image} for image in images],
        "categories": [{"id": number} for number in range(classes)],
        "annotations": [
            {"id": number, "iscrowd": 0, **_entry(edges, image, name)}
            for number, (edges, image, name) in enumerate(
                zip(scene.labelled, scene.labelled_image, scene.labelled_class, strict=True), 1
            )
        ],
    }
    found = COCO()
    found.dataset = {
        **truth.dataset,
        "annotations": [
            {"id": number, "iscrowd": 0, "score": float(score), **_entry(edges, image, name)}
            for number, (edges, image, name, score) in enumerate(
                zip(
                    scene.detected, scene.detected_image, scene.detected_class, scene.confidence, strict=True
                ),
                1,
            )
        ],
    }
    # It prints what it does.
    with contextlib.redirect_stdout(io.StringIO()):
        truth.createIndex()
        found.createIndex()
        evaluation = COCOeval(truth, found, "bbox")
        evaluation.params.maxDets = [1, 10, MOST_DETECTIONS]
        evaluation.evaluate()
        evaluation.accumulate()
    # (thresholds, recalls, classes, areas, detections): all areas, most detections.
    precision = evaluation.eval["precision"][:, :, :, 0, -1]
    mean = precision.mean(axis=1).T
    return np.where(precision.min(axis=1).T < 0, np.nan, mean)


def _entry(edges: NDArray[np.float64], image: int, name: int) -> dict[str, object]:
    x_min, y_min, x_max, y_max = edges.tolist()
    box = [x_min, y_min, x_max - x_min, y_max - y_min]
    return {"image_id": int(image), "category_id": int(name), "bbox": box, "area": box[2] * box[3]}
