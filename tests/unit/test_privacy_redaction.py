"""Lossless redaction against Pillow-made JPEGs, read back by jpeglib and OpenCV."""

import io

import cv2
import jpeglib
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from card.errors import CardError
from card.privacy.detection import Detection
from card.privacy.redaction import FILL, redact

LAYOUTS = {
    "4:4:4": {"subsampling": 0},
    "4:2:2": {"subsampling": 1},
    "4:2:0": {"subsampling": 2},
    "progressive": {"progressive": True},
    "restart markers": {"restart_marker_rows": 1},
    "grey": {},
}


def jpeg(layout: str, height: int, width: int, seed: int = 0) -> bytes:
    rng = np.random.default_rng(seed)
    shape = (height, width) if layout == "grey" else (height, width, 3)
    stream = io.BytesIO()
    Image.fromarray(rng.integers(0, 256, shape, dtype=np.uint8)).save(
        stream, "JPEG", quality=90, **LAYOUTS[layout]
    )
    return stream.getvalue()


def box(x_min: float, y_min: float, x_max: float, y_max: float) -> Detection:
    return Detection("face", x_min, y_min, x_max, y_max, score=1.0, source="test", model_sha256="")


def coefficients(content: bytes, path) -> tuple[list[np.ndarray], np.ndarray, jpeglib.DCTJPEG]:
    path.write_bytes(content)
    image = jpeglib.read_dct(str(path))
    image.load()
    return [c for c in (image.Y, image.Cb, image.Cr) if c is not None], image.samp_factor, image


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    layout=st.sampled_from(sorted(LAYOUTS)),
    size=st.tuples(st.integers(8, 70), st.integers(8, 70)),
    corners=st.lists(st.tuples(*[st.floats(0, 1)] * 4), max_size=4),
)
def test_every_coefficient_outside_the_mask_is_identical(tmp_path, layout, size, corners):
    height, width = size
    boxes = [
        box(
            min(a, c) * (width - 1),
            min(b, d) * (height - 1),
            max(a, c) * (width - 1) + 1e-3,
            max(b, d) * (height - 1) + 1e-3,
        )
        for a, b, c, d in corners
    ]
    content = jpeg(layout, height, width)
    redacted = redact(content, boxes, dilation_px=0, where="image")
    before, factors, read = coefficients(content, tmp_path / "a.jpg")
    after, factors_after, read_after = coefficients(redacted.content, tmp_path / "b.jpg")

    assert np.array_equal(factors, factors_after)
    assert np.array_equal(read.qt[read.quant_tbl_no], read_after.qt[read_after.quant_tbl_no])
    for old, new, factor in zip(before, after, factors, strict=True):
        # A block of this component covers this many pixels; it is masked when its pixels are.
        step = 8 * factors.max(axis=0) // factor
        masked = np.zeros(old.shape[:2], dtype=bool)
        for x_min, y_min, x_max, y_max in redacted.areas:
            rows = slice(y_min // step[0], -(-y_max // step[0]))
            masked[rows, x_min // step[1] : -(-x_max // step[1])] = True
        assert np.array_equal(old[~masked], new[~masked])
        assert not new[masked].any()

    grey = cv2.imdecode(np.frombuffer(redacted.content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert grey.shape == (height, width)
    for one, area in zip(boxes, redacted.areas, strict=True):
        assert area[0] <= one.x_min + 0.5
        assert area[1] <= one.y_min + 0.5
        assert area[2] >= one.x_max + 0.5 or area[2] == width
        assert area[3] >= one.y_max + 0.5 or area[3] == height
        assert (grey[area[1] : area[3], area[0] : area[2]] == FILL).all()


def test_without_chroma_subsampling_no_pixel_outside_changes():
    content = jpeg("4:4:4", 61, 77)
    redacted = redact(content, [box(20, 20, 30, 30)], dilation_px=0, where="image")
    before = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    after = cv2.imdecode(np.frombuffer(redacted.content, np.uint8), cv2.IMREAD_COLOR)
    (area,) = redacted.areas
    assert area == (16, 16, 32, 32)
    assert (after[16:32, 16:32] == FILL).all()
    outside = np.ones(before.shape[:2], dtype=bool)
    outside[16:32, 16:32] = False
    assert np.array_equal(before[outside], after[outside])
    assert redacted.pixels == 256


def test_box_over_the_edge_is_cut_there():
    redacted = redact(jpeg("4:2:0", 50, 45), [box(-30, 40, 1000, 90)], dilation_px=0, where="image")
    assert redacted.areas == [(0, 32, 45, 50)]
    assert redacted.pixels == 45 * 18


def test_dilation_reaches_the_next_block():
    content = jpeg("4:4:4", 32, 32)
    assert redact(content, [box(8, 8, 15, 15)], dilation_px=0, where="image").areas == [(8, 8, 16, 16)]
    assert redact(content, [box(8, 8, 15, 15)], dilation_px=2, where="image").areas == [(0, 0, 24, 24)]


def test_no_box_leaves_the_image_as_it_was(tmp_path):
    content = jpeg("4:2:0", 33, 47)
    redacted = redact(content, [], dilation_px=2, where="image")
    assert (redacted.areas, redacted.pixels) == ([], 0)
    decoded = [
        cv2.imdecode(np.frombuffer(c, np.uint8), cv2.IMREAD_COLOR) for c in (content, redacted.content)
    ]
    assert np.array_equal(*decoded)


def test_five_hundred_boxes_fill_their_union():
    rng = np.random.default_rng(5)
    corners = rng.uniform(0, 390, (500, 2))
    boxes = [box(x, y, x + 8, y + 8) for x, y in corners]
    redacted = redact(jpeg("4:2:0", 400, 400), boxes, dilation_px=2, where="image")
    union = np.zeros((400, 400), dtype=bool)
    for x_min, y_min, x_max, y_max in redacted.areas:
        union[y_min:y_max, x_min:x_max] = True
    assert len(redacted.areas) == 500
    assert redacted.pixels == union.sum()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (box(100, 5, 120, 9), "outside the image"),
        (box(float("nan"), 5, 7, 9), "without an extent"),
        (box(9, 5, 7, 9), "without an extent"),
        (box(7, 3.5, 9, 3.5), "without an extent"),
    ],
)
def test_a_box_that_makes_no_sense_is_an_error(wrong, message):
    with pytest.raises(CardError, match=message):
        redact(jpeg("grey", 40, 40), [wrong], dilation_px=0, where="image")


def test_output_that_was_not_filled_is_refused(monkeypatch):
    from card.privacy import redaction

    content = jpeg("4:2:0", 48, 48)
    monkeypatch.setattr(redaction, "_written", lambda image, where: content)
    with pytest.raises(CardError, match="not constant"):
        redact(content, [box(10, 10, 20, 20)], dilation_px=0, where="image")


def test_output_that_changed_elsewhere_is_refused(monkeypatch):
    from card.privacy import redaction

    other = redact(jpeg("4:2:0", 48, 48, seed=1), [], dilation_px=0, where="image").content
    monkeypatch.setattr(redaction, "_written", lambda image, where: other)
    with pytest.raises(CardError, match=r"outside its mask|quantization"):
        redact(jpeg("4:2:0", 48, 48), [], dilation_px=0, where="image")
