"""Where points fall on a distorted image, compiled: the same as `CameraModel` gives, bit by bit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.geometry import CameraModel
from card.ground_truth.compiled import compiled


class Image(NamedTuple):
    """A camera and the field of view of its image.

    fx, fy, cx, cy, distortion, width, height : as in `CameraModel`. turn : square of its `max_radius`.
    low, high : (2,) bounds of x/z and y/z.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float]
    width: int
    height: int
    turn: float
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]

    @classmethod
    def of(cls, camera: CameraModel, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]) -> Image:
        """The image of a camera, with the bounds (2,), (2,) of its field of view."""
        pinhole = camera.fx, camera.fy, camera.cx, camera.cy
        size = camera.width, camera.height
        return cls(*pinhole, camera.distortion, *size, camera.max_radius**2, low, high)


@compiled
def on_image(points: Any, image: Image, index: Any, column: Any, row: Any) -> int:
    """Write the points (N, 3), camera frame, that fall on the image; return how many.

    index, column, row : (N,) int64, outputs: which points, and their pixels, rounded.
    """
    k1, k2, p1, p2, k3 = image.distortion
    count = 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not z > 0 or not (image.low[0] * z <= x <= image.high[0] * z):
            continue
        if not (image.low[1] * z <= y <= image.high[1] * z):
            continue
        x, y = x / z, y / z
        r2 = x * x + y * y
        if r2 >= image.turn:
            continue
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) * image.fx + image.cx
        v = (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) * image.fy + image.cy
        if u >= -0.5 and u < image.width - 0.5 and v >= -0.5 and v < image.height - 0.5:
            index[count], column[count], row[count] = i, np.int64(np.rint(u)), np.int64(np.rint(v))
            count += 1
    return count
