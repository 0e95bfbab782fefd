"""Undistortion and stereo rectification as maps from the wanted image's pixels to the taken one's."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.errors import CardError
from card.geometry.camera import CameraModel
from card.geometry.transforms import inverse

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rectification:
    """A stereo pair whose rows correspond: both cameras become `camera`, turned to share their axes.

    Attributes
    ----------
    camera : pinhole of both rectified images. left, right : the cameras as they are, with distortion.
    rectified_from_left, rectified_from_right : rotations (4, 4) of each camera into its rectified one.
    baseline_m : distance of the two centres, metres; the right one lies at +x.
    """

    camera: CameraModel
    left: CameraModel
    right: CameraModel
    rectified_from_left: Array
    rectified_from_right: Array
    baseline_m: float

    @property
    def Q(self) -> Array:
        """(4, 4): (u, v, disparity, 1) of the left rectified image to homogeneous metres in its frame.

        The form of OpenCV's ``stereoRectify``; depth is ``fx * baseline_m / disparity``.
        """
        c = self.camera
        return np.array([[1, 0, 0, -c.cx], [0, 1, 0, -c.cy], [0, 0, 0, c.fx], [0, 0, 1 / self.baseline_m, 0]])

    @cached_property
    def left_map(self) -> NDArray[np.float32]:
        """Pixels (H, W, 2) of the taken left image for each pixel of the rectified one."""
        return pixel_map(self.camera, self.left, inverse(self.rectified_from_left))

    @cached_property
    def right_map(self) -> NDArray[np.float32]:
        """Pixels (H, W, 2) of the taken right image for each pixel of the rectified one."""
        return pixel_map(self.camera, self.right, inverse(self.rectified_from_right))


def rectify(left: CameraModel, right: CameraModel, left_from_right: ArrayLike) -> Rectification:
    """Rectification of two cameras; ``left_from_right`` (4, 4).

    A. Fusiello, E. Trucco, A. Verri, "A compact algorithm for rectification of stereo pairs", Machine
    Vision and Applications 12, 2000: x along the baseline, z as near as can be to both optical axes. The
    pinhole has the mean focal length and principal point of the two.
    """
    pose = np.asarray(left_from_right, dtype=np.float64)
    baseline = float(np.linalg.norm(pose[:3, 3]))
    x = pose[:3, 3] / baseline if baseline > 0 else np.zeros(3)
    if x[0] <= 0:
        raise CardError(
            "the right camera is not right of the left one",
            found=f"{pose[0, 3]:g} m",
            wanted="> 0 m along x of camera_left",
        )
    y = np.cross(np.array([0.0, 0.0, 1.0]) + pose[:3, 2], x)
    y /= np.linalg.norm(y)
    rectified_from_left, rectified_from_right = np.eye(4), np.eye(4)
    rectified_from_left[:3, :3] = np.stack([x, y, np.cross(x, y)])
    rectified_from_right[:3, :3] = rectified_from_left[:3, :3] @ pose[:3, :3]
    focal = (left.fx + left.fy + right.fx + right.fy) / 4
    camera = CameraModel(
        left.width, left.height, focal, focal, (left.cx + right.cx) / 2, (left.cy + right.cy) / 2
    )
    return Rectification(camera, left, right, rectified_from_left, rectified_from_right, baseline)


def pixel_map(
    wanted: CameraModel, taken: CameraModel, taken_from_wanted: ArrayLike | None = None
) -> NDArray[np.float32]:
    """Pixels (H, W, 2) of image `taken` for each pixel of `wanted`, x and y; NaN where it sees nothing.

    Both cameras share their centre; ``taken_from_wanted`` (4, 4) turns one into the other. Without it the
    map undistorts.
    """
    v, u = np.mgrid[: wanted.height, : wanted.width]
    rays = wanted.rays(np.stack([u, v], axis=-1))
    if taken_from_wanted is not None:
        rays = rays @ np.asarray(taken_from_wanted, dtype=np.float64)[:3, :3].T
    return taken.project(rays).astype(np.float32)


def remap(image: NDArray[Any], pixels: NDArray[np.float32]) -> NDArray[Any]:
    """Image (H, W, ...) sampled bilinearly at ``pixels`` (H', W', 2); 0 where they leave the image."""
    height, width = image.shape[:2]
    x, y = pixels[..., 0], pixels[..., 1]
    inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    shape = (*x.shape, *(1 for _ in image.shape[2:]))
    a, b, known = (x - left).reshape(shape), (y - top).reshape(shape), inside.reshape(shape)
    above = image[top, left] * (1 - a) + image[top, right] * a
    below = image[bottom, left] * (1 - a) + image[bottom, right] * a
    mixed = np.where(known, above * (1 - b) + below * b, 0)
    return np.rint(mixed).astype(image.dtype) if image.dtype.kind in "iu" else mixed.astype(image.dtype)
