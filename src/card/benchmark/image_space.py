"""The image that a method predicts depth for: the left one as it is, undistorted, or rectified.

Whatever it is, the same pixels of the original image are evaluated and depth means z in `camera_left`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel
from card.packaging.reader.rig import Rig

Array = NDArray[np.float64]

SPACES = ("original", "undistorted", "rectified")


@dataclass(frozen=True)
class ImageSpace:
    """Camera of the predicted image and the rotation (3, 3) from `camera_left` to its axes."""

    name: str
    camera: CameraModel
    rotation: Array

    def sample(self, prediction: Array, rays: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Depth (M,) in camera_left that a prediction (H, W) gives for rays (M, 2) with z = 1; which it sees.

        Between pixels the inverse of depth is interpolated, which is exact on a plane; where one of the four
        pixels has no depth the nearest pixel counts. A ray that the image does not see has depth 0.
        """
        turned = np.column_stack([rays, np.ones(len(rays))]) @ self.rotation.T
        pixels = self.camera.project(turned)
        inside = self.camera.contains(pixels)
        u, v = np.where(inside[:, None], pixels, 0.0).T
        depth = _interpolate(prediction, u, v) / np.where(inside, turned[:, 2], 1.0)
        return np.where(inside, depth, 0.0), inside


def image_space(name: str, rig: Rig, camera: str = "camera_left") -> ImageSpace:
    """The space of a name in `SPACES` on a sequence's rig.

    camera : ``camera_right`` gives the space that a prediction for the wrong camera would be in.
    """
    if name == "rectified":
        pair = rig.stereo
        turned = pair.rectified_from_left if camera == "camera_left" else pair.rectified_from_right
        return ImageSpace(name, pair.camera, turned[:3, :3])
    suffix = "_undistorted" if name == "undistorted" else ""
    return ImageSpace(name, rig.camera(f"{camera}{suffix}"), np.eye(3))


def _interpolate(depth: Array, u: Array, v: Array) -> Array:
    """Depth (M,) at columns u and rows v (M,) within an image (H, W); 0 where there is none."""
    height, width = depth.shape
    column = np.clip(np.floor(u).astype(np.int64), 0, max(0, width - 2))
    row = np.clip(np.floor(v).astype(np.int64), 0, max(0, height - 2))
    right, below = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
    a, b = np.clip(u - column, 0, 1), np.clip(v - row, 0, 1)
    corners = np.stack([depth[row, column], depth[row, right], depth[below, column], depth[below, right]])
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
    given = (corners > 0).all(axis=0)
    mean = 1 / np.sum(weights / np.where(given, corners, 1.0), axis=0)
    nearest = depth[np.floor(v + 0.5).astype(np.int64), np.floor(u + 0.5).astype(np.int64)]
    return np.where(given, mean, np.nan_to_num(nearest, nan=0.0))
