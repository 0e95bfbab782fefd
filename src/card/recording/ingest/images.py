"""Are a camera's images sound: readable, whole, all of one size?"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from card.artifacts import progress
from card.errors import CardError

_END_OF_IMAGE = b"\xff\xd9"


def check_images(camera: str, paths: Sequence[Path]) -> tuple[int, int]:
    """Width and height in pixels that all images of a camera share.

    Reads the header and the end of each file: a JPEG that was cut off is found, a damaged scan is not.
    Raises CardError, naming the file, for one that is no whole JPEG or of another size than the first.
    """
    size: tuple[int, int] | None = None
    for path in progress(paths, f"check {camera}"):
        found = jpeg_size(path)
        if size is None:
            size = found
        if found != size:
            raise CardError(
                "image size changes",
                where=path,
                found=f"{found[0]} x {found[1]}",
                wanted=f"{size[0]} x {size[1]} as in {paths[0].name}",
            )
    assert size is not None, "the caller has checked that there are images"
    return size


def jpeg_size(path: Path) -> tuple[int, int]:
    """Width and height of a JPEG; CardError for a file that is none or ends early."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path, formats=["JPEG"]) as image:
            size = image.size
        with path.open("rb") as file:
            file.seek(-len(_END_OF_IMAGE), os.SEEK_END)
            whole = file.read() == _END_OF_IMAGE
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise CardError("unreadable JPEG", where=path, found=type(error).__name__) from error
    if not whole:
        raise CardError("JPEG ends early", where=path, wanted="an end-of-image marker at the end")
    return size
