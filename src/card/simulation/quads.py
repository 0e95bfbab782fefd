"""Textured rectangles: all that a board session shows, drawn and ray-cast in closed form."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel, inverse
from card.simulation.exposure import GAMMA
from card.simulation.lens import lens_of

Array = NDArray[np.float64]

#: Light (256,) of an 8 bit tone.
LIGHT = ((np.arange(256) / 255) ** GAMMA).astype(np.float32)


@dataclass(frozen=True)
class Quad:
    """A rectangle in the rig.

    rig_from_quad : (4, 4); the rectangle spans x in [0, width], y in [0, height] at z = 0.
    size_m : width and height, metres.
    texture : (H, W, 3) uint8 RGB, gamma 2.2, laid over the whole rectangle, first row at y = 0.
    intensity : reflectivity the LiDAR reports, 0 to 255.
    """

    rig_from_quad: Array
    size_m: tuple[float, float]
    texture: NDArray[np.uint8]
    intensity: int


def cast(quads: Sequence[Quad], origin: Array, directions: Array) -> tuple[Array, NDArray[np.int32], Array]:
    """First hits of rays (N, 3) from one origin (3,), in the rig.

    Returns ranges (N,) in units of the directions' length (inf where nothing is hit), the index of the quad
    (N,) int32 (-1), and the cosine of incidence (N,) for unit directions.
    """
    ranges = np.full(len(directions), np.inf)
    index = np.full(len(directions), -1, np.int32)
    cosine = np.zeros(len(directions))
    for number, quad in enumerate(quads):
        x, y, t, normal_part = _intersect(quad, origin, directions)
        hit = (t > 0) & (t < ranges) & _inside(quad, x, y)
        ranges[hit] = t[hit]
        index[hit] = number
        cosine[hit] = np.abs(normal_part[hit])
    return ranges, index, cosine


class QuadView:
    """A camera that looks at quads. The rays of its pixels are worked out once.

    camera : the distorted camera model.
    rig_from_camera : (4, 4).
    samples : each pixel averages samples x samples rays, which is its anti-aliasing.
    """

    def __init__(self, camera: CameraModel, rig_from_camera: Array, samples: int = 3) -> None:
        self.camera = camera
        self.rig_from_camera = rig_from_camera
        self.lens = lens_of(camera)
        self._rays = np.moveaxis(self.lens.rays, -1, 0)
        self._along = np.gradient(self._rays, axis=2), np.gradient(self._rays, axis=1)
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        self._offsets = [(du, dv) for dv in steps for du in steps]

    def draw(self, quads: Sequence[Quad], onto: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """The light (height, width, 3) float32, 1 for white, of quads listed from far to near.

        onto : a picture that lies behind them; it is left as it is. Without one the sky is grey.
        """
        shape = (self.camera.height, self.camera.width, 3)
        image = np.full(shape, LIGHT[170], np.float32) if onto is None else onto.copy()
        for quad in quads:
            self._draw_one(quad, image)
        return image

    def _draw_one(self, quad: Quad, image: NDArray[np.float32]) -> None:
        top, bottom, left, right = self._box(quad)
        if top >= bottom or left >= right:
            return
        window = np.s_[top:bottom, left:right]
        colour = np.zeros((bottom - top, right - left, 3), np.float32)
        cover = np.zeros((bottom - top, right - left, 1), np.float32)
        to_plane = _plane_from_ray(inverse(self.rig_from_camera) @ quad.rig_from_quad)
        rays, (along_u, along_v) = self._rays[:, *window], (a[:, *window] for a in self._along)
        for du, dv in self._offsets:
            a, b = rays + np.float32(du) * along_u + np.float32(dv) * along_v
            x, y, inverse_depth = (row[0] * a + row[1] * b + row[2] for row in to_plane)
            with np.errstate(divide="ignore", invalid="ignore"):
                x, y = x / inverse_depth, y / inverse_depth
            inside = ((inverse_depth > 0) & _inside(quad, x, y))[..., None]
            colour += np.where(inside, LIGHT[_sample(quad, x, y)], np.float32(0))
            cover += inside
        count = len(self._offsets)
        image[window] = image[window] * (1 - cover / count) + colour / count

    def _box(self, quad: Quad) -> tuple[int, int, int, int]:
        """Rows and columns that may show the quad: all of them unless it lies wholly before the camera."""
        width, height = quad.size_m
        edge = np.linspace(0, 1, 9)
        rim = np.concatenate(
            [
                np.c_[edge, edge * 0],
                np.c_[edge, edge * 0 + 1],
                np.c_[edge * 0, edge],
                np.c_[edge * 0 + 1, edge],
            ]
        ) * (width, height)
        camera_from_quad = inverse(self.rig_from_camera) @ quad.rig_from_quad
        points = rim @ camera_from_quad[:3, :2].T + camera_from_quad[:3, 3]
        if points[:, 2].min() < 0.3 or np.abs(points[:, :2] / points[:, 2:]).max() > 1.5:
            return 0, self.camera.height, 0, self.camera.width
        pixels = self.camera.project(points)
        low, high = np.floor(pixels.min(axis=0)) - 2, np.ceil(pixels.max(axis=0)) + 3
        left, right = np.clip((low[0], high[0]), 0, self.camera.width).astype(int)
        top, bottom = np.clip((low[1], high[1]), 0, self.camera.height).astype(int)
        return int(top), int(bottom), int(left), int(right)


def _intersect(quad: Quad, origin: Array, rays: Array) -> tuple[Array, Array, Array, Array]:
    """Where rays (..., 3) meet the quad's plane: x, y in it, ray parameter, ray along the normal."""
    rotation = quad.rig_from_quad[:3, :3]
    start = (origin - quad.rig_from_quad[:3, 3]) @ rotation
    local = rays @ rotation
    slope = local[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -start[2] / slope
        x, y = start[0] + t * local[..., 0], start[1] + t * local[..., 1]
    return x, y, t, slope


def _plane_from_ray(camera_from_quad: Array) -> NDArray[np.float32]:
    """Homography (3, 3) from a ray (a, b, 1) to (x, y, 1) / z: the quad's point it meets and its depth z."""
    return np.linalg.inv(camera_from_quad[:3, [0, 1, 3]]).astype(np.float32)


def _inside(quad: Quad, x: NDArray[Any], y: NDArray[Any]) -> NDArray[np.bool_]:
    return (x >= 0) & (x <= quad.size_m[0]) & (y >= 0) & (y <= quad.size_m[1])


def _sample(quad: Quad, x: NDArray[Any], y: NDArray[Any]) -> NDArray[np.uint8]:
    rows, columns = quad.texture.shape[:2]
    # Texel k covers [k, k + 1] / count of the side, so its centre is at k + 0.5.
    u = np.clip(x / quad.size_m[0] * columns - 0.5, 0, columns - 1).astype(np.float32)
    v = np.clip(y / quad.size_m[1] * rows - 0.5, 0, rows - 1).astype(np.float32)
    return np.asarray(cv2.remap(quad.texture, u, v, cv2.INTER_LINEAR), dtype=np.uint8)
