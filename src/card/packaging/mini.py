"""`mini.parquet`: a few frames with a thumbnail, to look at before a download."""

import io
from collections.abc import Sequence
from typing import Any

from card.packaging.modalities import Rows
from card.packaging.reader import Release


def mini_columns(release: Release, frames: Rows, per_sequence: int, side_px: int) -> dict[str, list[Any]]:
    """Columns of `release_mini`: frames spread evenly over each sequence of the tree.

    Thumbnails are made from the packed left images, which are anonymized.
    """
    names = ("sequence", "frame", "split", "width", "height", "image", "spdx")
    columns: dict[str, list[Any]] = {name: [] for name in names}
    by_sequence: dict[str, list[Any]] = {}
    for row in sorted(frames, key=lambda row: (row["sequence"], row["frame"])):
        if row["has_camera_left"]:
            by_sequence.setdefault(row["sequence"], []).append(row)
    for rows in by_sequence.values():
        for row in _spread(rows, per_sequence):
            width, height, jpeg = _thumbnail(
                release.read(row["sequence"], row["frame"], "camera_left"), side_px
            )
            cells = (row["sequence"], row["frame"], row["split"], width, height, jpeg, row["spdx"])
            for name, value in zip(names, cells, strict=True):
                columns[name].append(value)
    return columns


def _spread(rows: Sequence[Any], count: int) -> list[Any]:
    count = min(count, len(rows))
    return [rows[(2 * i + 1) * len(rows) // (2 * count)] for i in range(count)]


def _thumbnail(jpeg: bytes, side_px: int) -> tuple[int, int, bytes]:
    from PIL import Image

    with Image.open(io.BytesIO(jpeg)) as image:
        image.thumbnail((side_px, side_px))
        small = image.convert("RGB")
    buffer = io.BytesIO()
    small.save(buffer, "JPEG", quality=85)
    return small.width, small.height, buffer.getvalue()
