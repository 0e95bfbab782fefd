"""Label boxes as sets of pixels of the original image."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def box_span(box: Sequence[float], width: int, height: int) -> tuple[slice, slice]:
    """Rows and columns whose centre lies in a YOLO box: x and y of its centre, width, height, relative.

    Pixel centres are at integers, so the image's left and upper edges lie at -0.5. A box that reaches over
    the image is cut; one between pixel centres is empty.
    """
    x, y, w, h = box
    return _span(y, h, height), _span(x, w, width)


def inside(pixels: NDArray[np.int64], span: tuple[slice, slice], width: int) -> NDArray[np.int64]:
    """Which of the flat pixels (M,) of an image so many pixels wide lie in a span of rows and columns."""
    rows, columns = span
    # Rows are whole runs of flat pixels, which leaves few to ask for their column.
    near = np.flatnonzero((pixels >= rows.start * width) & (pixels < rows.stop * width))
    column = pixels[near] % width
    return near[(column >= columns.start) & (column < columns.stop)]


def _span(centre: float, extent: float, size: int) -> slice:
    first, last = ((centre + side * extent / 2) * size - 0.5 for side in (-1, 1))
    start, stop = (min(size, max(0, int(np.ceil(edge)))) for edge in (first, last))
    return slice(start, max(start, stop))
