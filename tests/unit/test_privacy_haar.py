"""The embedded detector on a photograph and on what the installed OpenCV may lack."""

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from card.artifacts import default_settings
from card.errors import CardError
from card.privacy.detection import Detection
from card.privacy.haar import HaarDetector, cascade_path

SETTINGS = default_settings("privacy")
OPTIONS = {name: SETTINGS[name] for name in ("face", "plate", "min_neighbors")}
# Hair line to chin and ear to ear, read off the picture by eye: x_min, y_min, x_max, y_max.
FACE = (82, 70, 188, 172)


@pytest.fixture(scope="module")
def astronaut() -> np.ndarray:
    return np.ascontiguousarray(data.astronaut()[:256, 90:346, ::-1])


def test_finds_the_whole_face_in_a_photograph(astronaut):
    found = HaarDetector(**OPTIONS).detect(astronaut)
    faces = [d for d in found if d.kind == "face"]
    assert any(
        d.x_min <= FACE[0] and d.y_min <= FACE[1] and d.x_max >= FACE[2] and d.y_max >= FACE[3] for d in faces
    )
    surest = max(faces, key=lambda d: d.score)
    centre = ((surest.x_min + surest.x_max) / 2, (surest.y_min + surest.y_max) / 2)
    assert centre == pytest.approx(((FACE[0] + FACE[2]) / 2, (FACE[1] + FACE[3]) / 2), abs=10)


def test_a_face_smaller_than_the_cascade_is_found_in_the_enlarged_image(astronaut):
    small = cv2.resize(astronaut, None, fx=0.15, fy=0.15, interpolation=cv2.INTER_AREA)
    wanted = [0.15 * edge for edge in FACE]
    for enlargement, hits in ((1, 0), (2, 1)):
        face = OPTIONS["face"] | {"enlargement": enlargement}
        found = [d for d in HaarDetector(**(OPTIONS | {"face": face})).detect(small) if d.kind == "face"]
        covering = [
            d
            for d in found
            if d.x_min <= wanted[0] and d.y_min <= wanted[1] and d.x_max >= wanted[2] and d.y_max >= wanted[3]
        ]
        assert len(covering) == hits


def test_same_image_gives_the_same_boxes(astronaut):
    first, second = (HaarDetector(**OPTIONS).detect(astronaut) for _ in range(2))
    assert first == second


def test_models_are_named_by_the_hash_of_their_file():
    detector = HaarDetector(**OPTIONS)
    assert set(detector.models) == {*OPTIONS["face"]["cascades"], *OPTIONS["plate"]["cascades"]}
    for name, digest in detector.models.items():
        assert digest == hashlib.sha256(cascade_path(name).read_bytes()).hexdigest()


@pytest.mark.parametrize("shape", [(1, 1, 3), (8, 400, 3), (140, 140, 3)])
def test_an_empty_image_has_no_boxes(shape):
    assert HaarDetector(**OPTIONS).detect(np.full(shape, 90, np.uint8)) == []


def test_growth_adds_its_share_on_each_side():
    box = Detection("plate", 10, 20, 50, 30, score=1.0, source="test").grown(0.25)
    assert (box.x_min, box.y_min, box.x_max, box.y_max) == (0, 17.5, 60, 32.5)


def test_missing_cascade_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setattr(cv2.data, "haarcascades", str(tmp_path))
    with pytest.raises(CardError, match=r"haarcascade_frontalface_alt2: no such cascade.*wanted opencv"):
        HaarDetector(**OPTIONS)


def test_opencv_without_cascades_is_an_error(monkeypatch):
    monkeypatch.delattr(cv2, "data")
    with pytest.raises(CardError, match="no such cascade"):
        cascade_path(Path("haarcascade_frontalface_default").name)
