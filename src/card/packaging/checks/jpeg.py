"""An image file holds one image and nothing that tells more than its pixels do."""

from collections.abc import Iterator

SOI, EOI, SOS, APP0 = 0xD8, 0xD9, 0xDA, 0xE0
ALLOWED = {0xC0, 0xC1, 0xC2, 0xC4, SOS, 0xDB, 0xDD}  # frame, tables, scan, restart interval
JFIF_LENGTH = 16  # of the segment's payload with its length field; more is a thumbnail
NAMES = {0xE1: "EXIF or XMP", 0xED: "IPTC", 0xFE: "a comment"}


def jpeg_problems(content: bytes) -> Iterator[str]:
    """What is wrong with a released JPEG: cut short, more than one image, segments beyond the pixels."""
    if content[:2] != bytes((0xFF, SOI)) or content[-2:] != bytes((0xFF, EOI)):
        yield "is not one whole JPEG"
        return
    at = 2
    while at + 4 <= len(content) and content[at] == 0xFF and content[at + 1] != EOI:
        marker, length = content[at + 1], int.from_bytes(content[at + 2 : at + 4], "big")
        if marker == APP0:
            if length != JFIF_LENGTH:
                yield "carries a thumbnail"
        elif marker not in ALLOWED:
            yield f"carries {NAMES.get(marker, f'a segment ff {marker:02x}')}, which can identify people"
        at += 2 + length
        if marker == SOS:
            at = _scan_end(content, at)
    if at + 2 != len(content):
        yield "has bytes that are not of its image"


def _scan_end(content: bytes, at: int) -> int:
    """First marker after entropy-coded data that is neither a stuffed zero nor a restart."""
    while 0 <= (at := content.find(b"\xff", at)) < len(content) - 1:
        if content[at + 1] != 0 and not 0xD0 <= content[at + 1] <= 0xD7:
            return at
        at += 2
    return len(content)
