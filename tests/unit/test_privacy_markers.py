"""What a JPEG may carry into and out of the privacy stage."""

import io

import numpy as np
import pytest
from PIL import Image

from card.errors import CardError
from card.privacy.markers import check_released, sanitized, segments

SECRET = b"52.5200 N, 13.4050 E"


def picture(mode: str = "RGB") -> Image.Image:
    rng = np.random.default_rng(1)
    return Image.fromarray(rng.integers(0, 256, (40, 56, 3), dtype=np.uint8)).convert(mode)


def encoded(image: Image.Image, kind: str = "JPEG", **options: object) -> bytes:
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


PLAIN = encoded(picture())


def with_segment(marker: int, payload: bytes) -> bytes:
    return PLAIN[:2] + bytes([0xFF, marker]) + (len(payload) + 2).to_bytes(2, "big") + payload + PLAIN[2:]


def test_exif_comment_profile_and_thumbnail_are_gone():
    exif = Image.Exif()
    exif[0x0112] = 6  # orientation
    exif[0x010E] = SECRET.decode()
    content = encoded(picture(), exif=exif, comment=SECRET, icc_profile=SECRET * 20)
    assert SECRET in content
    clean = sanitized(content, "image")
    assert SECRET not in clean
    assert not {0xE0, 0xE1, 0xE2, 0xFE} & {segment.marker for segment in segments(clean, "image")}
    pixels = [np.asarray(Image.open(io.BytesIO(c))) for c in (content, clean)]
    assert np.array_equal(*pixels)


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"restart_marker_blocks": 3}])
def test_a_second_image_after_the_end_is_gone(options):
    first, second = encoded(picture(), **options), encoded(picture().rotate(90, expand=True))
    assert sanitized(first + second, "image") == sanitized(first, "image")
    assert len(sanitized(first, "image")) <= len(first)


@pytest.mark.parametrize("kept", [0, 1, 2, 30, 300, len(PLAIN) - 2, len(PLAIN) - 1])
def test_truncated_file_is_an_error(kept):
    with pytest.raises(CardError, match=r"truncated JPEG|not a JPEG|without exactly one image"):
        sanitized(PLAIN[:kept], "image")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (encoded(picture(), "PNG"), "not a JPEG file.*found 89 50"),
        (encoded(picture("CMYK")), "not YCbCr"),
        (encoded(picture(), keep_rgb=True), "not YCbCr"),
        (PLAIN.replace(b"\xff\xc0\x00\x11\x08", b"\xff\xc0\x00\x11\x0c"), "found 12 bits"),
        (PLAIN.replace(b"\xff\xc0\x00\x11\x08", b"\xff\xc9\x00\x11\x08"), "found SOF9"),
        (PLAIN.replace(b"\xff\xc0\x00\x11\x08", b"\xff\xc3\x00\x11\x08"), "found SOF3"),
        (b"\xff\xd8\xff\xd9", "without exactly one image"),
        (PLAIN[:2] + b"\x00\x00" + PLAIN[2:], "broken JPEG.*byte 2"),
    ],
)
def test_what_cannot_be_redacted_is_an_error(content, message):
    with pytest.raises(CardError, match=message):
        sanitized(content, "image")


@pytest.mark.parametrize("marker", [0xE1, 0xE2, 0xED, 0xEE, 0xFE])
def test_released_image_with_a_foreign_segment_is_refused(marker):
    check_released(PLAIN, "image")
    with pytest.raises(CardError, match=f"allow-list.*ff {marker:02x}"):
        check_released(with_segment(marker, SECRET), "image")


def test_released_image_with_a_thumbnail_is_refused():
    thumbnail = b"JFIF\0\x01\x01\x00\x00\x01\x00\x01\x02\x02" + bytes(12)
    with pytest.raises(CardError, match=r"allow-list.*ff e0"):
        check_released(with_segment(0xE0, thumbnail), "image")


def test_released_image_with_bytes_after_its_end_is_refused():
    with pytest.raises(CardError, match=r"after its end.*found 5"):
        check_released(PLAIN + b"12345", "image")
