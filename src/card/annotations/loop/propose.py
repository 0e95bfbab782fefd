"""A user's detector on the frames that nobody has labelled yet, and on those it is measured by."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from card.annotations.loop.images import LeftImage, left_images
from card.annotations.loop.sample import REST, TRAIN
from card.artifacts import progress, write_report, write_table
from card.detection import OnnxDetector
from card.errors import CardError


def propose(
    *,
    images: Path,
    frames: Path,
    sample: Path,
    rows: Sequence[Mapping[str, Any]],
    way: str,
    detector: Mapping[str, Any],
    detections: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    sequence: str,
) -> None:
    """Run the detector that was trained on one split of the seed over a sequence's anonymized images.

    Parameters
    ----------
    images, frames : tables of these names; images in the folder of the anonymized ones.
    sample : the sheet, for its hash. rows : its rows of this sequence, as dicts.
    way : ``random`` or ``grouped``: the split on whose training frames the detector was trained.
    detector : model, sha256, license, classes and input as in ``settings/proposals``.
    detections : table ``detections`` to write: of the rest, and of the seed's validation and test frames.

    Raises
    ------
    CardError
        For a sampled frame without an anonymized image, a model that is not as said, or a class off the map.
    """
    found = left_images(images, frames)
    chosen = [row for row in rows if row[way] != TRAIN]
    model = Path(detector["model"])
    limits = {"confidence": settings["least_confidence"], "nms_iou": settings["nms_iou"]}
    network = OnnxDetector(
        model,
        sha256=detector["sha256"],
        classes=detector["classes"],
        settings={**detector, **limits},
    )
    columns: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    for row in progress(chosen, "detections"):
        if row["frame"] not in found:
            raise CardError("sampled frame has no anonymized image", where=f"{sequence} {row['frame']}")
        for line in _detect(network, found[row["frame"]]):
            for name, value in zip(COLUMNS, (row["frame"], *line), strict=True):
                columns[name].append(value)
    write_table(detections, columns, "detections")
    write_report(
        report,
        stage="detections",
        sequence=sequence,
        settings={**settings, "way": way, "detector": detector},
        inputs={"model": model, "sample": sample, "images": images, "frames": frames},
        counts={
            "frames": len(chosen),
            "frames_rest": sum(row["part"] == REST for row in chosen),
            "detections": len(columns["frame"]),
        },
        gates=gates,
        notes=[f"The model is under {detector['license']}, as its user declares."],
    )


COLUMNS = ("frame", "class", "confidence", "x_center", "y_center", "width", "height")


def _detect(network: OnnxDetector, image: LeftImage) -> list[tuple[Any, ...]]:
    from PIL import Image

    with Image.open(image.verified()) as file:
        pixels = np.asarray(file.convert("RGB"))
    width, height = image.width, image.height
    return [
        (
            one.name,
            one.confidence,
            (one.x_min + one.x_max) / 2 / width,
            (one.y_min + one.y_max) / 2 / height,
            (one.x_max - one.x_min) / width,
            (one.y_max - one.y_min) / height,
        )
        for one in network.detect(pixels)
    ]
