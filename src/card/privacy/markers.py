"""The segments of a JPEG file: which may come in, which may go out (ISO/IEC 10918-1, annex B)."""

from collections.abc import Iterator
from typing import NamedTuple

from card.errors import CardError

SOI, EOI, SOS, DNL, DQT, DHT, DRI = 0xD8, 0xD9, 0xDA, 0xDC, 0xDB, 0xC4, 0xDD
APP0, APP14 = 0xE0, 0xEE
_FRAMES_IN = {0xC0, 0xC1, 0xC2}  # baseline, extended and progressive Huffman
_FRAMES = set(range(0xC0, 0xD0)) - {DHT, 0xC8, 0xCC}
_IMAGE = {DQT, DHT, DRI, SOS} | _FRAMES_IN
_JFIF_BYTES = 18  # marker, length, "JFIF\0", version, density; no thumbnail


class Segment(NamedTuple):
    """A marker with its payload and, after SOS, the entropy-coded data: ``content[start:end]``."""

    marker: int
    start: int
    end: int


def segments(content: bytes, where: object) -> Iterator[Segment]:
    """The segments between the start marker and the first end marker, which are both left out.

    Raises ``CardError`` for another kind of file and for one that stops before its end marker.
    """
    if content[:2] != b"\xff\xd8":
        raise CardError(
            "not a JPEG file", where=where, found=content[:4].hex(" ") or "nothing", wanted="ff d8"
        )
    at = 2
    while True:
        start = at
        while content[at : at + 2] == b"\xff\xff":  # fill bytes before a marker
            at += 1
        if at + 2 > len(content):
            raise CardError(
                "truncated JPEG", where=where, found=f"{len(content)} bytes", wanted="an end marker"
            )
        if content[at] != 0xFF:
            raise CardError(
                "broken JPEG", where=where, found=f"{content[at]:02x} at byte {at}", wanted="a marker"
            )
        marker = content[at + 1]
        if marker == EOI:
            return
        end = at + 2 + int.from_bytes(content[at + 2 : at + 4], "big")
        if marker == SOS:
            end = _scan_end(content, end)
        if end > len(content) or end < at + 4:
            raise CardError(
                "truncated JPEG", where=where, found=f"{len(content)} bytes", wanted="an end marker"
            )
        yield Segment(marker, start, end)
        at = end


def _scan_end(content: bytes, at: int) -> int:
    """The first byte after entropy-coded data: a marker that is neither a stuffed zero nor a restart."""
    while True:
        at = content.find(b"\xff", at)
        if at < 0 or at + 1 >= len(content):
            return len(content)
        if content[at + 1] != 0x00 and not 0xD0 <= content[at + 1] <= 0xD7:
            return at
        at += 2


def sanitized(content: bytes, where: object) -> bytes:
    """``content`` cut down to the image it opens with: no EXIF, comment, thumbnail, nothing after the end.

    Raises ``CardError`` for what cannot be redacted losslessly here: not JPEG, truncated, arithmetic or
    lossless coding, 12 bits, CMYK or RGB instead of YCbCr or grey.
    """
    kept = [b"\xff\xd8"]
    frames = 0
    for segment in segments(content, where):
        payload = content[segment.start : segment.end].lstrip(b"\xff")[3:]
        if segment.marker in _FRAMES:
            frames += 1
            _check_frame(segment.marker, payload, where)
        if segment.marker == APP14 and payload[:5] == b"Adobe" and payload[11:12] == b"\0":
            # Transform 0: three components are RGB, and dropping this segment would change their meaning.
            raise CardError(
                "JPEG colours are not YCbCr", where=where, found="Adobe RGB or CMYK", wanted="YCbCr or grey"
            )
        if segment.marker == DNL:
            raise CardError("JPEG gives its height after its data", where=where)
        if segment.marker in _IMAGE:
            kept.append(content[segment.start : segment.end])
    if frames != 1 or kept[-1][1] != SOS:
        raise CardError("JPEG without exactly one image", where=where, found=f"{frames} frames", wanted="1")
    return b"".join([*kept, b"\xff\xd9"])


def _check_frame(marker: int, payload: bytes, where: object) -> None:
    if marker not in _FRAMES_IN:
        raise CardError(
            "JPEG coding not supported", where=where, found=f"SOF{marker - 0xC0}", wanted="SOF0, 1 or 2"
        )
    if payload[0] != 8:
        raise CardError("JPEG depth not supported", where=where, found=f"{payload[0]} bits", wanted="8 bits")
    components, identifiers = payload[5], payload[6::3]
    if components not in (1, 3) or identifiers == b"RGB":
        colours = "RGB" if components == 3 else f"{components} components"
        raise CardError("JPEG colours are not YCbCr", where=where, found=colours, wanted="YCbCr or grey")


def check_released(content: bytes, where: object) -> None:
    """Raise ``CardError`` unless ``content`` is one image with allowed segments only and nothing after it."""
    end = 2
    for segment in segments(content, where):
        bare_jfif = (
            segment.marker == APP0
            and segment.end - segment.start == _JFIF_BYTES
            and content[segment.start + 4 : segment.start + 9] == b"JFIF\0"
        )
        if segment.marker not in _IMAGE and not bare_jfif:
            raise CardError(
                "redacted image carries a segment outside the allow-list",
                where=where,
                found=f"ff {segment.marker:02x}",
            )
        end = segment.end
    if end + 2 != len(content):
        raise CardError(
            "redacted image carries bytes after its end", where=where, found=len(content) - end - 2
        )
