"""The images of a sequence, and worker processes for them."""

import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from card.artifacts import progress
from card.errors import CardError
from card.privacy.markers import sanitized

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Job:
    """One raw image: the camera, the time and the frame it belongs to, and its file below the recording."""

    camera: str
    t_ns: int
    frame: int
    source: Path


def image_jobs(recording: Path, frames: Any) -> list[Job]:
    """One job an image in table ``frames``, left cameras first, in the table's order.

    Raises
    ------
    CardError
        If there is none, or two images of a camera share a time.
    """
    jobs = []
    for camera, file, time in (
        ("camera_left", "left_file", "t_ns"),
        ("camera_right", "right_file", "right_t_ns"),
    ):
        rows = zip(*(frames[name].to_pylist() for name in (file, time, "frame")), strict=True)
        jobs += [Job(camera, t_ns, frame, recording / name) for name, t_ns, frame in rows if name is not None]
    if not jobs:
        raise CardError("no images to anonymize", where=recording)
    images = {(job.camera, job.t_ns) for job in jobs}
    if len(images) != len(jobs):
        raise CardError(
            "two images of one camera share a time", where=recording, found=len(images), wanted=len(jobs)
        )
    return jobs


def read_image(path: Path) -> tuple[bytes, bytes, NDArray[np.uint8]]:
    """The file, the same without metadata, and its pixels (H, W, 3) uint8 RGB.

    Raises
    ------
    CardError
        For a file that is missing, is no JPEG of a kind that can be redacted, or does not decode.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise CardError("image is missing", where=path, found=error.strerror) from error
    content = sanitized(raw, path)
    # The coded orientation is the sensor's: labels and boxes are in that image.
    image: Any = cv2.imdecode(
        np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    )
    if image is None:
        raise CardError("unreadable JPEG", where=path)
    return raw, content, np.ascontiguousarray(image[..., ::-1])


def in_processes(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    start: Callable[..., None],
    arguments: Iterable[Any],
    threads: int,
    label: str,
) -> Iterator[Result]:
    """Results of ``work`` in the order of ``items``, from processes that called ``start`` first."""
    # One thread keeps boxes in one order and shares the cores with the other processes. It is set before
    # the fork: a child cannot end threads that it did not inherit, and would wait for them for ever.
    cv2.setNumThreads(1)
    # Forked workers need no importable main module, which a workflow's script does not have.
    pool = ProcessPoolExecutor(
        max_workers=max(1, min(threads, len(items))),
        mp_context=multiprocessing.get_context("fork"),
        initializer=start,
        initargs=tuple(arguments),
    )
    with pool:
        yield from progress(pool.map(work, items), label, len(items))
