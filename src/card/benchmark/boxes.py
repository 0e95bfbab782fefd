"""Label boxes as sets of pixels of the original image."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def box_mask(box: Sequence[float], width: int, height: int) -> NDArray[np.bool_]:
    """Pixels (H, W) whose centre lies in a YOLO box: x and y of its centre, width, height, relative.

    Pixel centres are at integers, so the image's left and upper edges lie at -0.5. A box that reaches over
    the image is cut; one between pixel centres is empty.
    """
    x, y, w, h = box
    mask = np.zeros((height, width), dtype=np.bool_)
    mask[_span(y, h, height), _span(x, w, width)] = True
    return mask


def _span(centre: float, extent: float, size: int) -> slice:
    first, last = ((centre + side * extent / 2) * size - 0.5 for side in (-1, 1))
    return slice(max(0, int(np.ceil(first))), max(0, int(np.ceil(last))))
