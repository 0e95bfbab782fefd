"""A chessboard in one image: found at reduced size, its corners refined at full size, its picture judged."""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.calibration.chessboard_checks import edge_profile, goes_on

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

_FIND = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
#: Within this part of a square's side two detectors mean the same corner.
_SAME_SQUARES = 0.25
_REFINE = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)


def find_chessboard(
    image: Image, columns: int, rows: int, settings: Mapping[str, Any]
) -> tuple[Array | None, str]:
    """Inner corners (columns * rows, 2) in pixels, row by row; or None and why the view is refused.

    image : (height, width) uint8, grey.
    settings : section ``boards`` of the stage's settings.
    """
    corners = _search(image, columns, rows, settings["search_side_px"])
    if corners is None:
        return None, f"no board with {columns} x {rows} inner corners"
    lattice = _refined(image, corners, columns, rows, settings["corner_window_squares"])
    if _shortest_step(lattice) >= settings["sector_square_px"]:
        lattice = _by_sectors(image, lattice)
    lattice = _first_square_dark(image, lattice)
    contrast, width_px = edge_profile(image, lattice)
    if contrast < settings["min_contrast"]:
        return None, f"contrast {contrast:.0f} of 255, wanted {settings['min_contrast']:g}"
    if width_px > settings["max_edge_width_px"]:
        return None, f"blurred: edges {width_px:.1f} px wide, wanted {settings['max_edge_width_px']:g}"
    side = goes_on(image, lattice)
    if side is not None:
        return None, f"the pattern goes on beyond {columns} x {rows} inner corners at its {side}"
    return lattice.reshape(-1, 2), ""


def _search(image: Image, columns: int, rows: int, side_px: int) -> Array | None:
    """Rough corners (rows, columns, 2), searched at a size that the detector is fast at.

    Where that fails, a far board is searched at full size.
    """
    reduced = max(1, -(-max(image.shape) // side_px))
    # OpenCV's quick look overlooks boards now and then; at full size a thorough one would take seconds.
    tries = [(reduced, _FIND)] + [(1, _FIND | cv2.CALIB_CB_FAST_CHECK)] * (reduced > 1)
    for step, flags in tries:
        small = cv2.resize(image, None, fx=1 / step, fy=1 / step, interpolation=cv2.INTER_AREA)
        found, pixels = cv2.findChessboardCorners(small, (columns, rows), flags=flags)
        if found:
            # Pixel centres are at integers: the middle of a block of pixels is not at its first one.
            return np.asarray(pixels[:, 0] * step + (step - 1) / 2, np.float64).reshape(rows, columns, 2)
    return None


def _refined(image: Image, corners: Array, columns: int, rows: int, share: float) -> Array:
    """Saddle points (rows, columns, 2), in windows that hold no other corner."""
    half = max(2, round(share * _shortest_step(corners)))
    points = np.ascontiguousarray(corners.reshape(-1, 1, 2), dtype=np.float32)
    fine = cv2.cornerSubPix(image, points, (half, half), (-1, -1), _REFINE)
    return np.asarray(fine, dtype=np.float64).reshape(rows, columns, 2)


def _by_sectors(image: Image, lattice: Array) -> Array:
    """The same corners by the sector-based detector, run on the board alone; unchanged where it disagrees.

    A. Duda and U. Frese, "Accurate Detection and Localization of Checkerboard Corners for Calibration", BMVC
    2018. It is the more exact one where squares are large. Where they are small, what lies beyond the pattern
    draws its outer corners outwards by hundredths of a pixel: that is a larger board, a longer focal length.
    """
    rows, columns = lattice.shape[:2]
    rim = 2.5 * max(np.linalg.norm(np.diff(lattice, axis=axis), axis=-1).max() for axis in (0, 1))
    low = np.maximum(lattice.min(axis=(0, 1)) - rim, 0).astype(int)
    high = (lattice.max(axis=(0, 1)) + rim).astype(int) + 1
    crop = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    found, pixels = cv2.findChessboardCornersSB(crop, (columns, rows), flags=cv2.CALIB_CB_ACCURACY)
    if not found:
        return lattice
    exact = np.asarray(pixels[:, 0] + low, dtype=np.float64).reshape(rows, columns, 2)
    exact = min((exact, exact[::-1, ::-1]), key=lambda turned: float(np.abs(turned - lattice).max()))
    same = np.abs(exact - lattice).max() < _SAME_SQUARES * _shortest_step(lattice)
    return exact if same else lattice


def _shortest_step(lattice: Array) -> float:
    return float(min(np.linalg.norm(np.diff(lattice, axis=axis), axis=-1).min() for axis in (0, 1)))


def _first_square_dark(image: Image, lattice: Array) -> Array:
    """The lattice turned by half a turn if need be: the square after the first corner is dark."""
    middles = (lattice[:-1, :-1] + lattice[1:, :-1] + lattice[:-1, 1:] + lattice[1:, 1:]) / 4
    column, row = np.rint(middles).astype(int).reshape(-1, 2).T
    inside = (column >= 0) & (row >= 0) & (column < image.shape[1]) & (row < image.shape[0])
    tone = np.where(inside, image[row * inside, column * inside], np.nan)
    dark = (np.indices(middles.shape[:2]).sum(axis=0) % 2 == 0).ravel()
    return lattice if np.nanmean(tone[dark]) <= np.nanmean(tone[~dark]) else lattice[::-1, ::-1]
