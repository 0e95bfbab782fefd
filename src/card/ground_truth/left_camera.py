"""What the left camera can see: field of view, image and the car's own body (paper, supplement E)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts.masks import read_ego_mask
from card.geometry import CameraModel, from_json
from card.ground_truth.image_pixels import Image, on_image
from card.ground_truth.raster_order import raster_order

Points = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class LeftCamera:
    """The left camera of a calibration.

    image: the original, distorted image. undistorted: the image the ego mask belongs to.
    ego: (H, W) bool, where the car itself is on the undistorted image; from row `ego_top` on, H for none.
    rig_from_camera: (4, 4).
    """

    def __init__(self, calibration: Mapping[str, Any], ego_mask: Path) -> None:
        self.image = CameraModel.from_json(calibration["cameras"]["camera_left"])
        self.undistorted = CameraModel.from_json(calibration["camera_left_undistorted"])
        self.rig_from_camera = from_json(calibration["extrinsics"]["rig_from_camera_left"])
        self.ego = read_ego_mask(ego_mask, self.undistorted.width, self.undistorted.height) == 255
        self.ego_top = int(np.argmax(np.append(self.ego.any(axis=1), True)))
        border = self.image.rays(_border(self.image.width, self.image.height))[:, :2]
        self._low, self._high = border.min(axis=0), border.max(axis=0)

    def bounds(self, margin_rad: float) -> tuple[Points, Points]:
        """Smallest and largest (x/z, y/z) of the image, widened on every side by an angle."""
        low, high = np.arctan(self._low) - margin_rad, np.arctan(self._high) + margin_rad
        limit = np.pi / 2 - 0.01
        return np.tan(np.maximum(low, -limit)), np.tan(np.minimum(high, limit))

    def in_view(self, points: Points, margin_rad: float, nearest_m: float) -> Mask:
        """Points (N, 3), camera frame, within the field of view plus a margin and no nearer than z."""
        low, high = self.bounds(margin_rad)
        xy, z = points[:, :2], points[:, 2:]
        inside: Mask = (z[:, 0] >= nearest_m) & ((xy >= low * z) & (xy <= high * z)).all(axis=1)
        return inside

    def may_be_in_view(self, centres: Points, radius: float, margin_rad: float, nearest_m: float) -> Mask:
        """Balls (N, 3) of `radius` (m) that `in_view` may keep a point of; none that it does is missed."""
        low, high = self.bounds(margin_rad)
        xy, z = centres[:, :2], centres[:, 2:]
        above = xy - low * z >= -radius * np.sqrt(1 + low**2)
        below = high * z - xy >= -radius * np.sqrt(1 + high**2)
        inside: Mask = (z[:, 0] >= nearest_m - radius) & (above & below).all(axis=1)
        return inside

    def on_ego(self, points: Points) -> Mask:
        """Points (N, 3), z > 0, whose undistorted projection falls on the car's own body.

        The original image sees a little beyond the undistorted one: there the mask's edge goes on.
        """
        column, row = np.rint(self.undistorted.project(points)).T
        column = np.clip(column, 0, self.undistorted.width - 1).astype(np.int64)
        row = np.clip(row, 0, self.undistorted.height - 1).astype(np.int64)
        return self.ego[row, column]

    def raster(self, points: Points) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Indices of the points (N, 3) on the original image, by row, column and depth; their pixels (K, 2).

        Pixels are (column, row), rounded. Beyond the image the distortion may fold back onto it: only
        points within the image's own field of view count.
        """
        found = np.empty((3, len(points)), dtype=np.int64)
        found = found[:, : on_image(points, Image.of(self.image, *self.bounds(0.0)), *found)]
        order = raster_order(np.take(points, found[0], axis=0), found[1], found[2])
        return found[0, order], found[1:, order].T


def _border(width: int, height: int) -> Points:
    """Pixels along the outer edge of an image, (N, 2)."""
    u, v = np.linspace(-0.5, width - 0.5, 65), np.linspace(-0.5, height - 0.5, 65)
    rows = [np.stack([u, np.full_like(u, y)], axis=1) for y in (v[0], v[-1])]
    columns = [np.stack([np.full_like(v, x), v], axis=1) for x in (u[0], u[-1])]
    return np.concatenate(rows + columns)
