"""The embedded detectors on photographs, and what must stop a release."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from card.artifacts import default_settings, sha256_file
from card.errors import CardError
from card.privacy.centerface import CenterFaceDetector
from card.privacy.detection import Detection
from card.privacy.detectors import detectors_of, models_of
from card.privacy.models import CENTERFACE, TEXT, PackagedModel
from card.privacy.text import TextDetector

SETTINGS = default_settings("privacy")
TILE = SETTINGS["tile_px"], SETTINGS["tile_overlap_px"]
# Hair line to chin and ear to ear, read off the picture by eye: x_min, y_min, x_max, y_max.
FACE = (82, 70, 188, 172)


@pytest.fixture(scope="module")
def astronaut() -> np.ndarray:
    return np.ascontiguousarray(data.astronaut()[:256, 90:346])


@pytest.fixture(scope="module")
def faces() -> CenterFaceDetector:
    return CenterFaceDetector(SETTINGS["face"], *TILE)


@pytest.fixture(scope="module")
def text() -> TextDetector:
    return TextDetector(SETTINGS["plate"], *TILE)


def holding(found: list[Detection], wanted: tuple[float, ...]) -> list[Detection]:
    return [
        d
        for d in found
        if d.x_min <= wanted[0] and d.y_min <= wanted[1] and d.x_max >= wanted[2] and d.y_max >= wanted[3]
    ]


def plate(height: int, width: int = 1400) -> tuple[np.ndarray, tuple[float, ...]]:
    """A grey street with one plate of dark characters on white, and the plate's box."""
    image = np.full((900, width, 3), 110, dtype=np.uint8)
    x, y = 203, 171
    scale = 0.72 * cv2.getFontScaleFromHeight(cv2.FONT_HERSHEY_DUPLEX, round(0.6 * height), 1)
    (text_width, _), _ = cv2.getTextSize("KA PC 4711", cv2.FONT_HERSHEY_DUPLEX, scale, 1)
    wide = text_width + round(0.9 * height)
    image[y : y + height, x : x + wide] = 235
    place = (x + round(0.45 * height), y + round(0.8 * height))
    cv2.putText(image, "KA PC 4711", place, cv2.FONT_HERSHEY_DUPLEX, scale, (20, 20, 20), 1, cv2.LINE_AA)
    return image, (x, y, x + wide - 1, y + height - 1)


@pytest.mark.parametrize("zoom", [2.0, 1.0, 0.5, 0.25])
def test_finds_the_whole_face_in_a_photograph(astronaut, faces, zoom):
    image = cv2.resize(astronaut, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
    assert holding(faces.detect(image), tuple(zoom * edge for edge in FACE))


def test_a_smaller_face_is_found_in_the_enlarged_image(astronaut, faces):
    small = cv2.resize(astronaut, None, fx=0.1, fy=0.1, interpolation=cv2.INTER_AREA)
    wanted = tuple(0.1 * edge for edge in FACE)
    larger = CenterFaceDetector(SETTINGS["face"] | {"enlargement": 3}, *TILE)
    assert not holding(faces.detect(small), wanted)
    assert holding(larger.detect(small), wanted)


@pytest.mark.parametrize("height", [16, 24, 40])
def test_finds_a_plate_by_its_text(text, height):
    image, box = plate(height)
    assert holding(text.detect(image), box)


def test_a_street_without_text_has_no_plate(text):
    assert text.detect(np.full((300, 300, 3), 110, dtype=np.uint8)) == []


def test_tiles_find_what_the_whole_image_does(astronaut, text):
    image = np.full((700, 1500, 3), 110, dtype=np.uint8)
    image[300:556, 500:756] = astronaut
    tiled = CenterFaceDetector(SETTINGS["face"], 512, 160)
    assert holding(tiled.detect(image), (582, 370, 688, 472))
    street, box = plate(24)
    assert holding(TextDetector(SETTINGS["plate"], 320, 160).detect(street), box)


def test_same_image_gives_the_same_boxes(astronaut, faces, text):
    for detector in (faces, text):
        assert detector.detect(astronaut) == detector.detect(astronaut.copy())


@pytest.mark.parametrize("shape", [(1, 1, 3), (20, 7, 3), (0, 0, 3)])
def test_a_tiny_image_has_no_boxes(faces, text, shape):
    image = np.zeros(shape, dtype=np.uint8)
    assert faces.detect(image) == text.detect(image) == []


@pytest.mark.parametrize("model", [CENTERFACE, TEXT])
def test_packaged_models_have_the_pinned_hash_and_a_permissive_licence(model):
    assert sha256_file(model.path()) == model.sha256
    assert model.license in ("MIT", "Apache-2.0")


def test_a_model_that_is_missing_or_another_one_is_refused():
    with pytest.raises(CardError, match="model of the embedded detector is missing"):
        PackagedModel("m", "a_package_nobody_has", "m.onnx", "0" * 64, "MIT").path()
    with pytest.raises(CardError, match="model of the embedded detector is missing"):
        PackagedModel("m", "numpy", "m.onnx", "0" * 64, "MIT").path()
    with pytest.raises(CardError, match="another hash"):
        PackagedModel("m", "numpy", "__init__.py", "0" * 64, "MIT").path()


def test_there_must_be_a_detector():
    with pytest.raises(CardError, match="no detector"):
        detectors_of(SETTINGS | {"embedded": False})


def test_a_users_model_that_is_missing_is_refused():
    model = {"path": "nowhere.onnx", "sha256": "0" * 64, "license": "MIT", "classes": ["face"]}
    model |= {"input": "native", "size_px": 1024, "overlap_px": 0}
    with pytest.raises(CardError, match=r"model is missing|nowhere.onnx"):
        detectors_of(SETTINGS | {"models": [model]})


def test_models_are_named_with_hash_and_licence():
    assert models_of(SETTINGS) == [
        {"name": model.name, "sha256": model.sha256, "license": model.license} for model in (CENTERFACE, TEXT)
    ]


def test_growth_adds_its_share_on_each_side():
    box = Detection("face", 10, 20, 20, 40, score=1, source="m", model_sha256="")
    assert box.grown(0.5, 0.25).edges == (5, 15, 25, 45)


def test_models_ship_with_packages_not_with_this_repository():
    root = Path(__file__).resolve().parents[2]
    assert not [path for path in (root / "src").rglob("*") if path.suffix in (".onnx", ".pt", ".tflite")]
