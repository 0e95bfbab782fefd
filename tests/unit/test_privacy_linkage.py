"""Why the default is one constant: a redacted face must not lead to its neighbours in time or space.

An attacker has near-identical captures of a hundred people (other frames, the stereo partner) and the
redacted pixels of one of them, and takes the capture that looks most alike after the same redaction.
"""

import io

import cv2
import numpy as np
import pytest
from PIL import Image
from skimage import data

from card.privacy.detection import Detection
from card.privacy.redaction import redact

SIZE = 64
PEOPLE = 100


@pytest.fixture(scope="module")
def captures() -> tuple[np.ndarray, np.ndarray]:
    """Two near-identical captures (100, 64, 64) of each face: a shift, other light, noise."""
    rng = np.random.default_rng(4)
    faces = (255 * data.lfw_subset()[:PEOPLE]).astype(np.float32)
    large = np.stack([cv2.resize(face, (SIZE, SIZE), interpolation=cv2.INTER_CUBIC) for face in faces])
    other = np.roll(large, 1, axis=2) * 1.03
    noisy = [np.clip(shot + rng.normal(0, 2, shot.shape), 0, 255).astype(np.uint8) for shot in (large, other)]
    return noisy[0], noisy[1]


def filled(face: np.ndarray) -> np.ndarray:
    """The face as the privacy stage releases it."""
    stream = io.BytesIO()
    Image.fromarray(face).save(stream, "JPEG", quality=95)
    box = Detection("face", 0, 0, SIZE - 1, SIZE - 1, score=1.0, source="test", model_sha256="")
    content = redact(stream.getvalue(), [box], dilation_px=2, where="face").content
    return np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE))


def blurred(face: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.GaussianBlur(face, (0, 0), 0.2 * SIZE))


def pixelated(face: np.ndarray) -> np.ndarray:
    small = cv2.resize(face, (8, 8), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (SIZE, SIZE), interpolation=cv2.INTER_NEAREST))


def linked_pct(captures: tuple[np.ndarray, np.ndarray], redaction) -> float:
    """Share of the redacted faces whose nearest capture, redacted alike, is of the same person."""
    one, other = (np.stack([redaction(face) for face in shots]).reshape(PEOPLE, -1) for shots in captures)
    distance = np.linalg.norm(one[:, None].astype(np.float32) - other[None].astype(np.float32), axis=2)
    return 100 * float(np.mean(distance.argmin(axis=1) == np.arange(PEOPLE)))


def test_a_constant_fill_links_no_better_than_chance(captures):
    # All distances are equal: whatever the attacker picks is a guess among a hundred.
    assert linked_pct(captures, filled) <= 100 / PEOPLE
    assert len({filled(face).tobytes() for face in captures[0]}) == 1


@pytest.mark.parametrize("weaker", [blurred, pixelated])
def test_blur_and_pixelation_give_people_away(captures, weaker):
    assert linked_pct(captures, weaker) >= 60
