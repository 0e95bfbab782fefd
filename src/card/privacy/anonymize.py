"""The privacy stage: every image of a sequence detected, redacted and accounted for."""

import multiprocessing
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from hashlib import sha256
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from card.artifacts import atomic_folder, inventory, progress, read_table, write_table
from card.errors import CardError
from card.privacy.account import Job, Outcome, image_columns, redaction_columns, write_account
from card.privacy.detection import Detector
from card.privacy.haar import HaarDetector
from card.privacy.markers import sanitized
from card.privacy.recall import read_labels
from card.privacy.redaction import redact


def anonymize(
    *,
    recording: Path,
    frames: Path,
    labelled: Path,
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    threads: int,
) -> None:
    """Write ``out``: a redacted copy of every left and right image in ``frames``, and the account of it.

    Parameters
    ----------
    recording : folder with ``camera_left|right/<t_ns>.jpg``.
    frames : table ``frames`` of the sequence.
    labelled : ``privacy_labels.csv``, where a person labelled some images; without it recall is unknown.
    out : folder ``results/<id>/anonymized``, written whole or not at all.
    settings : as ``settings/privacy``.
    threads : worker processes; the bytes do not depend on it.

    Raises ``CardError`` when a single image cannot be read, redacted or verified: then nothing is written.
    """
    detector = _detector(settings)
    labels = read_labels(labelled) if labelled.is_file() else None
    with atomic_folder(out) as folder, tempfile.TemporaryDirectory() as scratch:
        jobs = _jobs(recording, read_table(frames, "frames"), folder)
        # Forked workers need no importable main module, which a Snakemake script does not have.
        pool = ProcessPoolExecutor(
            max_workers=max(1, min(threads, len(jobs))),
            mp_context=multiprocessing.get_context("fork"),
            initializer=_start_worker,
            initargs=(settings, scratch),
        )
        with pool:
            outcomes = list(
                progress(pool.map(_anonymize_image, jobs), f"privacy {out.parent.name}", len(jobs))
            )
        write_table(folder / "images.parquet", image_columns(jobs, outcomes, folder, detector), "images")
        write_table(folder / "redactions.parquet", redaction_columns(jobs, outcomes, detector), "redactions")
        write_table(folder / "inventory.parquet", inventory(folder), "inventory")
    write_account(
        report,
        sequence=out.parent.name,
        inputs={"frames": frames} | ({} if labels is None else {"privacy_labels": labelled}),
        labels=labels or [],
        settings=settings,
        gates=gates,
        jobs=jobs,
        outcomes=outcomes,
    )


def _detector(settings: Mapping[str, Any]) -> Detector:
    return HaarDetector(
        face=settings["face"], plate=settings["plate"], min_neighbors=settings["min_neighbors"]
    )


def _jobs(recording: Path, table: Any, folder: Path) -> list[Job]:
    """One job an image, left cameras first, in time order."""
    jobs = []
    for camera, file, time in (
        ("camera_left", "left_file", "t_ns"),
        ("camera_right", "right_file", "right_t_ns"),
    ):
        for name, t_ns in zip(table[file].to_pylist(), table[time].to_pylist(), strict=True):
            if name is not None:
                jobs.append(Job(camera, t_ns, recording / name, folder / camera / f"{t_ns}.jpg"))
    if not jobs:
        raise CardError("no images to anonymize", where=recording)
    targets = {job.target for job in jobs}
    if len(targets) != len(jobs):
        raise CardError(
            "two images of one camera share a time", where=recording, found=len(targets), wanted=len(jobs)
        )
    for target in targets:
        target.parent.mkdir(exist_ok=True)
    return jobs


_worker: tuple[Detector, float]


def _start_worker(settings: Mapping[str, Any], scratch: str) -> None:
    global _worker
    # jpeglib leaves its copies of a raw image behind when it fails: keep them where they are removed.
    tempfile.tempdir = scratch
    _worker = _detector(settings), settings["dilation_px"]


def _anonymize_image(job: Job) -> Outcome:
    detector, dilation_px = _worker
    try:
        raw = job.source.read_bytes()
    except OSError as error:
        raise CardError("image is missing", where=job.source, found=error.strerror) from error
    content = sanitized(raw, job.source)
    image: Any = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise CardError("unreadable JPEG", where=job.source)
    detections = detector.detect(image)
    redacted = redact(content, detections, dilation_px=dilation_px, where=job.source)
    job.target.write_bytes(redacted.content)
    height, width = image.shape[:2]
    hashes = sha256(redacted.content).hexdigest(), sha256(raw).hexdigest()
    return Outcome(width, height, detections, redacted.areas, redacted.pixels, *hashes)
