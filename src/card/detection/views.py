"""How an image gets into a network's input: padded, scaled into a square, or in tiles."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

STRIDE = 32
"""Sides of the input are multiples of the network's coarsest stride."""
GREY = 114
"""Value of the border with which these networks are trained."""


@dataclass(frozen=True)
class View:
    """One input (H, W, 3) uint8, and where it lies: image px = (input px - shift) / scale + origin."""

    pixels: NDArray[np.uint8]
    scale: float
    shift: tuple[int, int]
    origin: tuple[int, int]

    def to_image(self, edges: NDArray[np.float64]) -> NDArray[np.float64]:
        """Edges (N, 4) in px of the input as edges in px of the image."""
        shift, origin = np.tile(self.shift, 2), np.tile(self.origin, 2)
        return (edges - shift) / self.scale + origin


def native(image: NDArray[np.uint8]) -> View:
    """The image as it is, padded at the right and below to multiples of `STRIDE`."""
    height, width = (-(-side // STRIDE) * STRIDE for side in image.shape[:2])
    return View(_bordered(image, width, height, (0, 0)), 1.0, (0, 0), (0, 0))


def letterbox(image: NDArray[np.uint8], size: int) -> View:
    """The image scaled to fit a square of ``size`` px, grey borders on both sides."""
    import cv2

    height, width = image.shape[:2]
    scale = size / max(height, width)
    inner = round(width * scale), round(height * scale)
    scaled = np.asarray(cv2.resize(image, inner, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    shift = (size - inner[0]) // 2, (size - inner[1]) // 2
    return View(_bordered(scaled, size, size, shift), scale, shift, (0, 0))


def tiles(image: NDArray[np.uint8], size: int, overlap: int) -> Iterator[View]:
    """Squares of ``size`` px at native resolution that overlap by at least ``overlap`` px."""
    height, width = image.shape[:2]
    for top in _starts(height, size, overlap):
        for left in _starts(width, size, overlap):
            part = image[top : top + size, left : left + size]
            yield View(_bordered(part, size, size, (0, 0)), 1.0, (0, 0), (left, top))


def _starts(length: int, size: int, overlap: int) -> list[int]:
    if length <= size:
        return [0]
    count = -(-(length - overlap) // (size - overlap))
    return [round(k * (length - size) / (count - 1)) for k in range(count)]


def _bordered(image: NDArray[np.uint8], width: int, height: int, shift: tuple[int, int]) -> NDArray[np.uint8]:
    pixels = np.full((height, width, 3), GREY, dtype=np.uint8)
    pixels[shift[1] : shift[1] + image.shape[0], shift[0] : shift[0] + image.shape[1]] = image
    return pixels
