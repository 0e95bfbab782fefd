"""The images of a sequence."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.privacy.markers import sanitized


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
