"""Rows of the tables ``private_detections`` and ``redactions``."""

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from card.artifacts import read_table
from card.privacy.detection import Detection
from card.privacy.jobs import Job
from card.privacy.redaction import Area

Image = tuple[str, int]  # camera, t_ns


def detection_columns(rows: Iterable[tuple[Job, Detection]]) -> dict[str, list[Any]]:
    """Columns of table ``private_detections``."""
    names = ("camera", "t_ns", "kind", "x_min", "y_min", "x_max", "y_max", "score", "source", "model_sha256")
    cells = [
        (job.camera, job.t_ns, box.kind, *box.edges, box.score, box.source, box.model_sha256)
        for job, box in rows
    ]
    return {name: [row[index] for row in cells] for index, name in enumerate(names)}


def read_detections(path: Path) -> dict[Image, list[Detection]]:
    """Boxes of table ``private_detections`` by image, in the table's order."""
    found: dict[Image, list[Detection]] = defaultdict(list)
    for row in read_table(path, "private_detections").to_pylist():
        found[row.pop("camera"), row.pop("t_ns")].append(Detection(**row))
    return found


def redaction_columns(rows: Iterable[tuple[Job, Detection, Area]]) -> dict[str, list[Any]]:
    """Columns of table ``redactions``."""
    names = (
        *("camera", "t_ns", "frame", "kind", "x_min", "y_min", "x_max", "y_max"),
        *("score", "source", "model_sha256"),
    )
    cells = [
        (job.camera, job.t_ns, job.frame, box.kind, *area, box.score, box.source, box.model_sha256)
        for job, box, area in rows
    ]
    return {name: [row[index] for row in cells] for index, name in enumerate(names)}
