"""The mask of the car's own parts in the undistorted left image."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts.atomic import atomic_file
from card.errors import CardError

Mask = NDArray[np.uint8]


def read_ego_mask(path: Path, width: int, height: int) -> Mask:
    """The mask (height, width): 255 = car, 0 = world.

    Raises
    ------
    CardError
        If it cannot be read, has another size, more than one channel or other values.
    """
    import cv2

    mask = cv2.imdecode(np.frombuffer(path.read_bytes(), dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if mask is None:
        raise CardError("unreadable ego mask", where=path, wanted="PNG")
    if mask.shape != (height, width):
        raise CardError(
            "ego mask of the wrong size",
            where=path,
            found=" x ".join(str(size) for size in (mask.shape[1], mask.shape[0], *mask.shape[2:])),
            wanted=f"{width} x {height}, one channel, as the undistorted left image",
        )
    values = np.unique(mask)
    if mask.dtype != np.uint8 or not set(values.tolist()) <= {0, 255}:
        raise CardError(
            "ego mask has other values", where=path, found=values[:5].tolist(), wanted="0 and 255"
        )
    return np.asarray(mask, dtype=np.uint8)


def write_ego_mask(path: Path, mask: Mask) -> None:
    """Write a mask as PNG; the same mask gives the same bytes."""
    import cv2

    encoded, png = cv2.imencode(".png", mask)
    assert encoded
    with atomic_file(path) as partial:
        partial.write_bytes(png.tobytes())
