"""The calibration board: its pattern, its marked points, and its picture.

Board frame: origin at the first inner corner, x along a row of corners, y down the rows, z away from the
viewer; so a board seen upright has x to the right and y down, as the cameras do.
"""

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# An even and an odd count: turned by half a turn the pattern differs, so its corners have one order only.
INNER_CORNERS = (8, 5)
SQUARE_M = 0.11
MARGIN_M = 0.07
SIZE_M = (
    (INNER_CORNERS[0] + 1) * SQUARE_M + 2 * MARGIN_M,
    (INNER_CORNERS[1] + 1) * SQUARE_M + 2 * MARGIN_M,
)
"""Width and height of the plate."""
PLATE_CORNER_M = (-SQUARE_M - MARGIN_M, -SQUARE_M - MARGIN_M)
"""The plate's upper left corner in the board frame."""

_TEXEL_M = 0.001


def corners_m() -> Array:
    """Inner corners (40, 3) in the board frame, row by row, as OpenCV orders them."""
    y, x = np.mgrid[0 : INNER_CORNERS[1], 0 : INNER_CORNERS[0]]
    return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3) * SQUARE_M


def marked_points_m() -> Array:
    """The eight points (8, 3) on the plate that the total station measures: p1 to p8, clockwise."""
    inset = 0.03
    left, top = np.array(PLATE_CORNER_M) + inset
    right, bottom = np.array(PLATE_CORNER_M) + SIZE_M - inset
    middle_x, middle_y = (left + right) / 2, (top + bottom) / 2
    plane = [
        (left, top),
        (middle_x, top),
        (right, top),
        (right, middle_y),
        (right, bottom),
        (middle_x, bottom),
        (left, bottom),
        (left, middle_y),
    ]
    return np.array([(x, y, 0.0) for x, y in plane])


def description() -> dict[str, Any]:
    """The document of `board.yaml` (schema ``board``)."""
    return {
        "schema": "board",
        "pattern": "chessboard",
        "inner_corners": list(INNER_CORNERS),
        "square_m": SQUARE_M,
        "size_m": [round(v, 6) for v in SIZE_M],
        "plate_corner_m": [round(v, 6) for v in PLATE_CORNER_M],
        "marked_points_m": [[round(float(v), 6) for v in point] for point in marked_points_m()[:, :2]],
    }


@functools.cache
def texture() -> NDArray[np.uint8]:
    """The plate's face (H, W, 3) uint8 at 1 mm, first row at the top."""
    rows, columns = (round(side / _TEXEL_M) for side in reversed(SIZE_M))
    y, x = np.mgrid[0:rows, 0:columns]
    x_m = (x + 0.5) * _TEXEL_M + PLATE_CORNER_M[0]
    y_m = (y + 0.5) * _TEXEL_M + PLATE_CORNER_M[1]
    column, row = np.floor(x_m / SQUARE_M), np.floor(y_m / SQUARE_M)
    on_pattern = (column >= -1) & (column < INNER_CORNERS[0]) & (row >= -1) & (row < INNER_CORNERS[1])
    black = on_pattern & ((column + row) % 2 == 0)
    for mark_x, mark_y, _ in marked_points_m():
        radius = np.hypot(x_m - mark_x, y_m - mark_y)
        black |= (radius < 0.012) & (radius > 0.008) | (radius < 0.002)
    return np.where(black[..., None], 22, 235).repeat(3, axis=-1).astype(np.uint8)
