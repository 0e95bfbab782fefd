"""The linkage attack: does a redacted face lead to a near-identical capture of the same person?

An attacker has such captures of a hundred people, other frames or the stereo partner, redacts them alike, and
takes the one most like the redacted face he wants to name.
"""

import io
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from card.privacy.detection import Detection
from card.privacy.redaction import redact

SIZE_PX, PEOPLE = 64, 100
Face = NDArray[np.uint8]
Redaction = Callable[[Face], Face]


def captures(seed: int = 4) -> tuple[Face, Face]:
    """Two captures (100, 64, 64) of each of a hundred photographed faces: a shift, other light, noise."""
    from skimage import data

    rng = np.random.default_rng(seed)
    faces = (255 * data.lfw_subset()[:PEOPLE]).astype(np.float32)
    one = np.stack([cv2.resize(face, (SIZE_PX, SIZE_PX), interpolation=cv2.INTER_CUBIC) for face in faces])
    other = np.roll(one, 1, axis=2) * 1.03
    first, second = (
        np.clip(shots + rng.normal(0, 2, shots.shape), 0, 255).astype(np.uint8) for shots in (one, other)
    )
    return first, second


def filled(face: Face) -> Face:
    """The face (64, 64) as the privacy stage releases it."""
    stream = io.BytesIO()
    Image.fromarray(face).save(stream, "JPEG", quality=95)
    box = Detection("face", 0, 0, SIZE_PX - 1, SIZE_PX - 1, 1.0, "linkage", "")
    content = redact(stream.getvalue(), [box], dilation_px=2, where="face").content
    return np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def blurred(face: Face) -> Face:
    """The face under a Gaussian of a fifth of its width."""
    return np.asarray(cv2.GaussianBlur(face, (0, 0), 0.2 * SIZE_PX), dtype=np.uint8)


def pixelated(face: Face) -> Face:
    """The face in eight by eight blocks."""
    small = cv2.resize(face, (8, 8), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (SIZE_PX, SIZE_PX), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


def linked_pct(redaction: Redaction) -> float:
    """Percent of redacted faces whose nearest capture is of the same person; by chance it is one."""
    one, other = (np.stack([redaction(face) for face in shots]).reshape(PEOPLE, -1) for shots in captures())
    difference = one[:, None].astype(np.float32) - other[None].astype(np.float32)
    nearest = np.linalg.norm(difference, axis=2).argmin(axis=1)
    return 100 * float(np.mean(nearest == np.arange(PEOPLE)))
