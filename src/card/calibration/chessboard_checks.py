"""What a picture of a chessboard is worth: contrast, sharpness, whether it is part of a larger one."""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

_SAMPLES = 41  # along a line across an edge
_FEW_POINTS = 0.6  # share of a side's points beyond it that look like corners of a larger board


def edge_profile(image: Image, lattice: Array) -> tuple[float, float]:
    """Contrast (8 bit tones) and width (px) of the edges of a lattice (rows, columns, 2) of corners.

    The width of an edge is its contrast by its steepest slope: 1 px or so for a sharp lens. Both are medians
    over the edges between neighbours in a row and in a column.
    """
    contrasts, widths = [], []
    for along in (lattice, np.swapaxes(lattice, 0, 1)):
        middle = (along[1:-1, :-1] + along[1:-1, 1:]) / 2
        # From the middle of the square on one side of an edge to that on the other.
        across = (along[2:, :-1] + along[2:, 1:] - along[:-2, :-1] - along[:-2, 1:]) / 4
        if middle.size:
            contrast, width = _edges(image, middle.reshape(-1, 2), across.reshape(-1, 2))
            contrasts.append(contrast)
            widths.append(width)
    return float(np.median(np.concatenate(contrasts))), float(np.median(np.concatenate(widths)))


def _edges(image: Image, middle: Array, across: Array) -> tuple[Array, Array]:
    share = np.linspace(-0.45, 0.45, _SAMPLES)
    tones = _tones(image, middle[:, None] + share[:, None] * across[:, None])
    low, high = np.percentile(tones, (10, 90), axis=1)
    step_px = np.linalg.norm(across, axis=1) * (share[1] - share[0])
    # Over steps of about a pixel: pixel noise would make any shorter slope steep.
    apart = int(np.clip(round(1 / float(np.median(step_px))), 1, _SAMPLES // 4))
    slope = np.abs(tones[:, apart:] - tones[:, :-apart]).max(axis=1) / (apart * step_px)
    return high - low, (high - low) / np.maximum(slope, 1e-9)


def goes_on(image: Image, lattice: Array) -> str | None:
    """The side ("left", "right", "top" or "bottom") at which a chessboard goes on beyond the lattice, if any.

    One step beyond the inner corners lie the outer ends of the outermost squares, where dark meets light
    in two quadrants only. Where most of these points have dark and light squares crosswise, they are inner
    corners too: the detector took part of a larger board for the whole.
    """
    sides = {
        "left": (lattice[:, 0], lattice[:, 1]),
        "right": (lattice[:, -1], lattice[:, -2]),
        "top": (lattice[0], lattice[1]),
        "bottom": (lattice[-1], lattice[-2]),
    }
    for name, (rim, inner) in sides.items():
        out = rim - inner
        along = np.gradient(rim, axis=0)
        beyond = rim + out
        quadrants = np.stack(
            [
                _tones(image, beyond + 0.35 * (a * out + b * along))
                for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))
            ]
        )
        # Crosswise: both diagonals even in themselves and apart from each other.
        first, second = quadrants[[0, 2]], quadrants[[1, 3]]
        spread = np.maximum(np.ptp(first, axis=0), np.ptp(second, axis=0))
        apart = np.abs(first.mean(axis=0) - second.mean(axis=0))
        rows, columns = image.shape
        inside = ((beyond > 0) & (beyond < (columns - 1, rows - 1))).all(axis=1)
        if inside.sum() >= 2 and np.mean((apart > 2 * spread)[inside] & (apart > 20)[inside]) > _FEW_POINTS:
            return name
    return None


def _tones(image: Image, points: Array) -> Array:
    """Tones (...) at points (..., 2) in pixels, between pixels by interpolation."""
    flat = np.ascontiguousarray(points.reshape(-1, 2), dtype=np.float32)
    values = cv2.remap(
        image, flat[None, :, 0], flat[None, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(values, dtype=np.float64).reshape(points.shape[:-1])
