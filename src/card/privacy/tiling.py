"""An image as the packaged networks see it, tile by tile."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from card.detection.views import View, tiles


def enlarged_tiles(
    image: NDArray[np.uint8], enlargement: float, size_px: int, overlap_px: int
) -> Iterator[View]:
    """Tiles of an image (H, W, 3) enlarged by a factor; their `to_image` leads back to the enlarged image."""
    import cv2

    if not image.size:
        return
    if enlargement > 1:
        larger = cv2.resize(image, None, fx=enlargement, fy=enlargement, interpolation=cv2.INTER_CUBIC)
        image = np.asarray(larger, dtype=np.uint8)
    # A small image needs no tile of full size, only whole strides of the network.
    size = min(size_px, -(-max(image.shape[:2]) // 32) * 32)
    yield from tiles(image, size, min(overlap_px, size // 2))
