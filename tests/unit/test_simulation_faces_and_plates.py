"""Faces and plates are there for a detector that never saw this code."""

import cv2
import numpy as np
import pytest

from card.errors import CardError
from card.simulation.faces_and_plates import PLATE_SIZE_M, face_texture, plate_texture


def _found_at_centre(scene: np.ndarray, cascade: str, width: int) -> bool:
    detector = cv2.CascadeClassifier(cv2.data.haarcascades + cascade)
    boxes = detector.detectMultiScale(cv2.cvtColor(scene, cv2.COLOR_RGB2GRAY), 1.05, 2, minSize=(12, 12))
    middle = np.array([scene.shape[1], scene.shape[0]]) / 2
    return any(np.all(abs(middle - (x + w / 2, y + h / 2)) < width / 4) for x, y, w, h in boxes)


def _on_grey(texture: np.ndarray, width: int) -> np.ndarray:
    height = round(width * texture.shape[0] / texture.shape[1])
    scene = np.full((height + 2 * width, 3 * width, 3), 70, np.uint8)
    scene[: height // 2 + width] = 45
    scene[width : width + height, width : 2 * width] = cv2.resize(
        texture, (width, height), interpolation=cv2.INTER_AREA
    )
    return scene


@pytest.mark.parametrize("width", [48, 64, 120])
@pytest.mark.parametrize("index", range(6))
def test_a_haar_detector_finds_each_face(index: int, width: int) -> None:
    assert _found_at_centre(
        _on_grey(face_texture(index), width), "haarcascade_frontalface_default.xml", width
    )


@pytest.mark.parametrize("width", [60, 120, 240])
@pytest.mark.parametrize("country", ["DE", "IT"])
def test_a_haar_detector_finds_each_plate(country: str, width: int) -> None:
    for seed in range(4):
        scene = _on_grey(plate_texture(country, np.random.default_rng(seed)), width)
        assert _found_at_centre(scene, "haarcascade_russian_plate_number.xml", width), seed


@pytest.mark.parametrize("country", ["DE", "IT"])
def test_plate_keeps_its_proportions_and_its_margin(country: str) -> None:
    for seed in range(30):
        plate = plate_texture(country, np.random.default_rng(seed))
        assert plate.shape[1] / plate.shape[0] == pytest.approx(PLATE_SIZE_M[1] / PLATE_SIZE_M[0])
        right = plate[20:200, 1010:1025] if country == "DE" else plate[110:200, 965:1025]
        assert len(np.unique(right.reshape(-1, 3), axis=0)) == 1, "characters run over the edge"


def test_same_index_same_face_and_other_index_another() -> None:
    assert np.array_equal(face_texture(3), face_texture(3))
    assert not np.array_equal(face_texture(3), face_texture(5))


def test_unknown_country_is_refused() -> None:
    with pytest.raises(CardError, match=r"no number plate.*found FR, wanted DE or IT"):
        plate_texture("FR", np.random.default_rng(0))
