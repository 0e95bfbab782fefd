"""First half of the privacy stage: every image of a sequence searched for faces and plates."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from card.artifacts import atomic_folder, progress, read_table, write_report, write_table
from card.artifacts.processes import in_processes
from card.privacy.detection import Detection, Detector
from card.privacy.detectors import detectors_of, models_of
from card.privacy.jobs import Job, image_jobs, read_image
from card.privacy.tables import detection_columns


@dataclass(frozen=True)
class Searched:
    """What was found in one image of ``width`` by ``height`` px whose file has hash ``sha256``."""

    width: int
    height: int
    sha256: str
    detections: list[Detection]


def search(
    *,
    recording: Path,
    frames: Path,
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    threads: int,
) -> None:
    """Write ``out``: tables ``searched_images``, a row an image, and ``private_detections``, a row a box.

    Parameters
    ----------
    recording : folder with ``camera_left|right/<t_ns>.jpg``.
    frames : table ``frames`` of the sequence.
    out : folder ``results/<id>/privacy_search``, written whole or not at all.
    settings : the detectors' part of ``settings/privacy``.
    threads : worker processes; the bytes do not depend on it.

    Raises
    ------
    CardError
        If there is no detector, or a single image cannot be read or searched: then nothing is written.
    """
    detectors_of(settings)
    jobs = image_jobs(recording, read_table(frames, "frames"))
    with atomic_folder(out) as folder:
        results = in_processes(_search, jobs, threads, prepare=partial(_start_worker, settings))
        found = list(progress(results, f"search {out.parent.name}", len(jobs)))
        images = {
            "camera": [job.camera for job in jobs],
            "t_ns": [job.t_ns for job in jobs],
            "frame": [job.frame for job in jobs],
            "width": [searched.width for searched in found],
            "height": [searched.height for searched in found],
            "sha256": [searched.sha256 for searched in found],
        }
        write_table(folder / "searched_images.parquet", images, "searched_images")
        rows = [(job, box) for job, searched in zip(jobs, found, strict=True) for box in searched.detections]
        write_table(folder / "detections.parquet", detection_columns(rows), "private_detections")
    kinds = [box.kind for _, box in rows]
    write_report(
        report,
        stage="privacy_search",
        sequence=out.parent.name,
        settings=settings,
        inputs={"frames": frames},
        counts={"images": len(jobs), "faces": kinds.count("face"), "plates": kinds.count("plate")},
        notes=[
            f"{model['name']} ({model['license']}), sha256 {model['sha256']}" for model in models_of(settings)
        ],
    )


_detectors: list[Detector]


def _start_worker(settings: Mapping[str, Any]) -> None:
    global _detectors
    _detectors = detectors_of(settings)


def _search(job: Job) -> Searched:
    raw, _, image = read_image(job.source)
    height, width = image.shape[:2]
    boxes = [box for detector in _detectors for box in detector.detect(image)]
    return Searched(
        width, height, sha256(raw).hexdigest(), [box for box in boxes if _within(box, width, height)]
    )


def _within(box: Detection, width: int, height: int) -> bool:
    """Whether any of the box lies on the image: a detector may mark what its padding holds."""
    return box.x_max > -0.5 and box.y_max > -0.5 and box.x_min < width - 0.5 and box.y_min < height - 0.5
