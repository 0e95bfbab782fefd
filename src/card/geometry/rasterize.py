"""Points to a depth map: the nearest z per rounded pixel."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.geometry.camera import CameraModel


def rasterize(points: ArrayLike, camera: CameraModel) -> NDArray[np.float64]:
    """Depth (H, W) in metres of points (N, 3) in the camera frame; NaN where no point falls.

    A point belongs to the pixel its projection rounds to (centres at integers). Depth is z; of several points
    in a pixel the nearest counts. Points behind the camera or beside the image are left out.
    """
    p = np.asarray(points, dtype=np.float64)
    p = p[p[:, 2] > 0]
    uv = camera.project(p)
    inside = camera.contains(uv)
    columns, rows = np.floor(uv[inside] + 0.5).astype(np.int64).T
    depth = np.full(camera.height * camera.width, np.inf)
    np.minimum.at(depth, rows * camera.width + columns, p[inside, 2])
    depth[np.isinf(depth)] = np.nan
    return depth.reshape(camera.height, camera.width)
