"""Motion blur of a global shutter: each pixel is the mean of what passed it while the shutter was open.

What is at a pixel in the middle of the exposure is taken to move on a straight line in the image; a pixel
looks along its own content's line. That is exact within one surface; an edge blurs on one side only.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from card.simulation.compiled import compiled

Array = NDArray[np.float64]
Image = NDArray[np.float32]

#: A line is sampled at least every so many pixels; shorter ones are left sharp.
_STEP_PX, _SHARP_PX = 1.0, 0.25
_MOST_SAMPLES = 96
_COLUMNS = 256


@compiled
def image_motion(rays: Image, jacobian: Image, closeness: Image, way: Image, turn: Image) -> Image:
    """How far (N, 2) in px what N pixels show moves during an exposure, x to the right and y down.

    rays : (N, 2), jacobian : (N, 4), of a `Lens`.  closeness : (N,), 1/depth, 0 for the sky.
    way : (N, 3) or (1, 3), how far it moves in the camera's frame, m.
    turn : (3,), by how much the camera turns, a rotation vector.
    """
    motion = np.empty((len(rays), 2), np.float32)
    for i in range(len(rays)):
        x, y, near, k = rays[i, 0], rays[i, 1], closeness[i], min(i, len(way) - 1)
        # The point z (x, y, 1) moves by its way - turn x point.
        ahead = way[k, 2] * near - (turn[0] * y - turn[1] * x)
        dx = way[k, 0] * near - (turn[1] - turn[2] * y) - x * ahead
        dy = way[k, 1] * near - (turn[2] * x - turn[0]) - y * ahead
        motion[i, 0] = jacobian[i, 0] * dx + jacobian[i, 1] * dy
        motion[i, 1] = jacobian[i, 2] * dx + jacobian[i, 3] * dy
    return motion


def blurred(sharp: Image, motion: Image, rows: int) -> Image:
    """The picture (H, W, 3) whose content moves by ``motion`` (H, W, 2), in tiles of so many rows."""
    out = sharp.copy()
    height, width = sharp.shape[:2]
    for top in range(0, height, rows):
        for left in range(0, width, _COLUMNS):
            tile = np.s_[top : top + rows, left : left + _COLUMNS]
            longest = float(np.abs(motion[tile]).max())
            if longest > _SHARP_PX:
                out[tile] = _smeared(sharp, motion[tile], top, left, longest)
    return out


def _smeared(sharp: Image, motion: Image, top: int, left: int, longest: float) -> Image:
    count = int(min(np.ceil(longest / _STEP_PX) + 1, _MOST_SAMPLES))
    total = np.zeros((*motion.shape[:2], 3), np.float32)
    u = np.arange(left, left + motion.shape[1], dtype=np.float32)
    v = np.arange(top, top + motion.shape[0], dtype=np.float32)[:, None]
    shares = (np.arange(count, dtype=np.float32) + np.float32(0.5)) / np.float32(count) - np.float32(0.5)
    for share in shares:
        total += cv2.remap(
            sharp,
            u + share * motion[..., 0],
            v + share * motion[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    return np.asarray(total / np.float32(count))
