"""Second half of the privacy stage: every image redacted, checked and accounted for."""

import tempfile
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_folder, inventory, progress, read_table, write_table
from card.artifacts.processes import in_processes
from card.errors import CardError
from card.privacy.account import Outcome, image_columns, write_account
from card.privacy.detectors import models_of
from card.privacy.jobs import Job, image_jobs, read_image
from card.privacy.propagate import Propagation
from card.privacy.recall import read_labels
from card.privacy.redaction import redact
from card.privacy.review import Review, check_images, read_reviews, reviewed
from card.privacy.sight import Sight
from card.privacy.tables import Image, read_detections, redaction_columns


def anonymize(
    *,
    recording: Path,
    frames: Path,
    detections: Path,
    sight: Mapping[str, Path],
    labelled: Path,
    reviews: Path,
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    threads: int,
) -> None:
    """Write ``out``: a redacted copy of every left and right image in ``frames``, and the account of it.

    Parameters
    ----------
    recording : folder with ``camera_left|right/<t_ns>.jpg`` and the bursts.
    frames : table ``frames`` of the sequence.
    detections : folder with tables ``searched_images`` and ``private_detections``.
    sight : ``calibration``, ``trajectory`` and ``bursts`` of the sequence, or nothing; then boxes are
        carried on in one camera only.
    labelled : ``privacy_labels.csv``, where a person labelled some images; without it recall is unknown.
    reviews : ``privacy_review.csv``, where a person added or cleared boxes; need not be there.
    out : folder ``results/<id>/anonymized``, written whole or not at all.
    settings : as ``settings/privacy``.
    threads : worker processes; the bytes do not depend on it.

    Raises
    ------
    CardError
        When a single image was not searched, or cannot be read, redacted or verified: then nothing is
        written.
    """
    labels = read_labels(labelled) if labelled.is_file() else None
    corrections = read_reviews(reviews) if reviews.is_file() else {}
    jobs = image_jobs(recording, read_table(frames, "frames"))
    check_images(corrections, {(job.camera, job.t_ns) for job in jobs}, reviews)
    boxes = read_detections(detections / "detections.parquet")
    table = read_table(detections / "searched_images.parquet", "searched_images").to_pylist()
    searched = {(row["camera"], row["t_ns"]): row["sha256"] for row in table}
    eyes = Sight(recording, **sight) if sight else None
    with atomic_folder(out) as folder, tempfile.TemporaryDirectory() as scratch:
        for camera in {job.camera for job in jobs}:
            (folder / camera).mkdir()
        start = partial(_start_worker, scratch, jobs, boxes, searched, corrections, eyes, folder, settings)
        results = in_processes(_anonymize_image, jobs, threads, prepare=start)
        outcomes = list(progress(results, f"privacy {out.parent.name}", len(jobs)))
        names = [model["name"] for model in models_of(settings)]
        write_table(folder / "images.parquet", image_columns(jobs, outcomes, names), "images")
        rows = [
            (job, box, area)
            for job, outcome in zip(jobs, outcomes, strict=True)
            for box, area in zip(outcome.boxes, outcome.areas, strict=True)
        ]
        write_table(folder / "redactions.parquet", redaction_columns(rows), "redactions")
        write_table(folder / "inventory.parquet", inventory(folder), "inventory")
    inputs: dict[str, Path] = {**sight, "frames": frames, "detections": detections / "detections.parquet"}
    inputs |= {"privacy_labels": labelled} if labels is not None else {}
    inputs |= {"privacy_review": reviews} if reviews.is_file() else {}
    write_account(
        report,
        sequence=out.parent.name,
        inputs=inputs,
        labels=labels or [],
        settings=settings,
        gates=gates,
        jobs=jobs,
        outcomes=outcomes,
        notes=[] if eyes else ["No poses: boxes were not carried between the cameras."],
    )


class _Worker:
    """What the images of a sequence share in one process."""

    def __init__(
        self,
        jobs: Sequence[Job],
        boxes: Mapping[Image, Any],
        searched: Mapping[Image, str],
        corrections: Mapping[Image, list[Review]],
        sight: Sight | None,
        folder: Path,
        settings: Mapping[str, Any],
    ) -> None:
        self.boxes, self.searched, self.corrections = boxes, searched, corrections
        self.folder, self.settings = folder, settings
        files = {(job.camera, job.t_ns): job.source for job in jobs}

        # Images come in order: each is decoded once for all that it is a neighbour of.
        @lru_cache(maxsize=4 * settings["propagation"]["neighbours"] + 4)
        def grey(image: Image) -> NDArray[np.uint8]:
            return np.asarray(cv2.cvtColor(read_image(files[image])[2], cv2.COLOR_RGB2GRAY), dtype=np.uint8)

        times: dict[str, list[int]] = {}
        frame_of: dict[str, dict[int, int]] = {"camera_left": {}, "camera_right": {}}
        for job in jobs:
            times.setdefault(job.camera, []).append(job.t_ns)
            frame_of[job.camera][job.frame] = job.t_ns
        pairs = {
            left: frame_of["camera_right"][frame]
            for frame, left in frame_of["camera_left"].items()
            if frame in frame_of["camera_right"]
        }
        ordered = {camera: sorted(all_t) for camera, all_t in times.items()}
        self.propagation = Propagation(boxes, ordered, pairs, sight, grey, settings["propagation"])


_worker: _Worker


def _start_worker(scratch: str, *shared: Any) -> None:
    global _worker
    # jpeglib leaves its copies of a raw image behind when it fails: keep them where they are removed.
    tempfile.tempdir = scratch
    _worker = _Worker(*shared)


def _anonymize_image(job: Job) -> Outcome:
    image = job.camera, job.t_ns
    raw, content, pixels = read_image(job.source)
    source_sha256 = sha256(raw).hexdigest()
    if _worker.searched.get(image) != source_sha256:
        raise CardError("image is not the one that was searched", where=job.source)
    boxes = [*_worker.boxes.get(image, ()), *_worker.propagation.into(image)]
    boxes = reviewed(boxes, _worker.corrections.get(image, ()), job.source)
    redacted = redact(content, boxes, dilation_px=_worker.settings["dilation_px"], where=job.source)
    file = f"{job.camera}/{job.t_ns}.jpg"
    (_worker.folder / file).write_bytes(redacted.content)
    height, width = pixels.shape[:2]
    hashes = sha256(redacted.content).hexdigest(), source_sha256
    return Outcome(file, width, height, boxes, redacted.areas, redacted.pixels, *hashes)
