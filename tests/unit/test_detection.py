"""A user's ONNX detector: where it looks, what it returns, what it refuses."""

import hashlib

import numpy as np
import pytest
from onnx_models import CELL, write_block_detector

from card.detection import Found, OnnxDetector
from card.detection.boxes import keep_best
from card.detection.views import letterbox, native, tiles
from card.errors import CardError

SETTINGS = {"input": "native", "size_px": 128, "overlap_px": 32, "confidence": 0.3, "nms_iou": 0.5}
RED, GREEN = (255, 0, 0), (0, 255, 0)


def picture(*cells: tuple[int, int, tuple[int, int, int]], size: tuple[int, int] = (200, 150)) -> np.ndarray:
    """An image of (width, height) with coloured cells at (column, row)."""
    image = np.full((size[1], size[0], 3), 90, np.uint8)
    for column, row, colour in cells:
        image[row * CELL : (row + 1) * CELL, column * CELL : (column + 1) * CELL] = colour
    return image


def detector(tmp_path, *, side=None, classes=("positive", "negative"), **settings) -> OnnxDetector:
    sha256 = write_block_detector(tmp_path / "blocks.onnx", side=side)
    return OnnxDetector(
        tmp_path / "blocks.onnx", sha256=sha256, classes=classes, settings=SETTINGS | settings
    )


def test_native_resolution_finds_each_class_where_it_is(tmp_path):
    found = detector(tmp_path).detect(picture((1, 2, RED), (4, 0, GREEN)))
    assert sorted((f.name, f.x_min, f.y_min, f.x_max, f.y_max) for f in found) == [
        ("negative", 128, 0, 160, 32),
        ("positive", 32, 64, 64, 96),
    ]
    assert all(f.confidence == pytest.approx(1) for f in found)


def test_a_box_is_cut_at_the_image(tmp_path):
    (found,) = detector(tmp_path).detect(picture((6, 4, RED), size=(220, 150)))
    assert (found.x_min, found.y_min, found.x_max, found.y_max) == (192, 128, 220, 150)


def test_letterbox_scales_there_and_back(tmp_path):
    image = np.full((512, 256, 3), 90, np.uint8)
    image[128:256, 128:256] = RED
    (found,) = detector(tmp_path, side=128, input="letterbox", nms_iou=0.9).detect(image)
    assert (found.x_min, found.y_min, found.x_max, found.y_max) == (128, 128, 256, 256)


def test_tiles_cover_everything_and_a_thing_in_two_is_found_once(tmp_path):
    image = picture((0, 0, RED), (3, 1, GREEN), (6, 5, RED), size=(224, 224))
    found = detector(tmp_path, side=128, input="tiles").detect(image)
    assert sorted((f.x_min, f.y_min) for f in found) == [(0, 0), (96, 32), (192, 160)]


def test_classes_can_be_left_out(tmp_path):
    found = detector(tmp_path, classes=("-", "plate")).detect(picture((1, 2, RED), (4, 0, GREEN)))
    assert [f.name for f in found] == ["plate"]


def test_nothing_found_is_an_empty_list(tmp_path):
    assert detector(tmp_path).detect(picture()) == []


@pytest.mark.parametrize("size", [(64, 64), (200, 150), (333, 97), (31, 500)])
def test_views_lie_where_they_say(size):
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)
    seen = np.zeros(image.shape[:2], bool)
    for view in [native(image), *tiles(image, 64, 16)]:
        assert view.pixels.shape[0] % 32 == view.pixels.shape[1] % 32 == 0
        left, top = view.origin
        part = image[top : top + view.pixels.shape[0], left : left + view.pixels.shape[1]]
        np.testing.assert_array_equal(view.pixels[: part.shape[0], : part.shape[1]], part)
    for view in tiles(image, 64, 16):
        seen[view.origin[1] : view.origin[1] + 64, view.origin[0] : view.origin[0] + 64] = True
    assert seen.all()
    boxed = letterbox(image, 64)
    assert boxed.pixels.shape == (64, 64, 3)
    corners = np.array([[*boxed.shift, *boxed.shift]], float)
    np.testing.assert_allclose(boxed.to_image(corners), 0)


def test_only_the_best_of_overlapping_boxes_of_a_class_stays():
    edges = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [0, 0, 10, 10], [50, 0, 60, 10]], float)
    kept = keep_best(edges, np.array([0.5, 0.9, 0.8, 0.7]), np.array([0, 0, 1, 0]), 0.5)
    assert kept.tolist() == [1, 2, 3]


def test_equal_scores_keep_their_order():
    edges = np.array([[0, 0, 10, 10], [0, 0, 10, 10], [20, 0, 30, 10]], float)
    assert keep_best(edges, np.full(3, 0.5), np.zeros(3, np.int64), 0.5).tolist() == [0, 2]


def test_a_model_that_is_not_as_said_is_refused(tmp_path):
    path = tmp_path / "m.onnx"
    sha256 = write_block_detector(path)
    made = {"sha256": sha256, "classes": ("a", "b"), "settings": SETTINGS}
    with pytest.raises(CardError, match=r"m.onnx: model has another hash \(found [0-9a-f]{64}, wanted 00"):
        OnnxDetector(path, **made | {"sha256": "00"})
    with pytest.raises(CardError, match=r"gone.onnx: model is missing"):
        OnnxDetector(tmp_path / "gone.onnx", **made)
    with pytest.raises(CardError, match=r"another output \(found \[\(1, 6, 4\)\], wanted one of \(1, 7, "):
        OnnxDetector(path, **made | {"classes": ("a", "b", "c")}).detect(picture(size=(64, 64)))
    for shape, line in (("rows", "another output"), ("logits", "no confidences .found 0 to 9")):
        sha256 = write_block_detector(path, shape=shape)
        broken = OnnxDetector(path, **made | {"sha256": sha256})
        with pytest.raises(CardError, match=line):
            broken.detect(picture((0, 0, RED), size=(64, 64)))
    sha256 = write_block_detector(path, side=128)
    tiled = SETTINGS | {"input": "tiles"}
    with pytest.raises(CardError, match="takes images of one size only"):
        OnnxDetector(path, **made | {"sha256": sha256})
    with pytest.raises(CardError, match=r"takes another size \(found \[128, 128\], wanted 256"):
        OnnxDetector(path, **made | {"sha256": sha256, "settings": tiled | {"size_px": 256}})
    with pytest.raises(CardError, match="no multiple"):
        OnnxDetector(path, **made | {"sha256": sha256, "settings": tiled | {"size_px": 100}})
    path.write_bytes(b"no model")
    with pytest.raises(CardError, match="model is no ONNX"):
        OnnxDetector(path, **made | {"sha256": hashlib.sha256(b"no model").hexdigest()})


def test_found_is_plain_numbers(tmp_path):
    (found,) = detector(tmp_path).detect(picture((1, 2, RED)))
    assert isinstance(found, Found)
    assert all(type(value) is float for value in (found.confidence, found.x_min, found.y_max))
