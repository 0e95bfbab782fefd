"""A camera's lens: the ray of every pixel, how pixels move with their rays, and how dark the corners are."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel

Image = NDArray[np.float32]

#: Half of the natural fall-off: cos^4 of the field angle would be a lens without any care for its corners.
VIGNETTING_POWER = 2.0
_BAND_PX = 60_000


@dataclass(frozen=True)
class Lens:
    """What does not change from picture to picture, all float32.

    rays : (H, W, 2), x and y of each pixel's ray at z = 1.
    length : (H, W), length of (x, y, 1).
    jacobian : (H, W, 4), du/dx, du/dy, dv/dx, dv/dy of pixels over rays, px.
    """

    model: CameraModel
    rays: Image
    length: Image
    jacobian: Image

    def bands(self) -> list[slice]:
        """Slices of rows whose pixels, some ten thousand, fit into a processor's cache."""
        step = max(1, _BAND_PX // self.model.width)
        return [slice(row, row + step) for row in range(0, self.model.height, step)]

    @cached_property
    def vignetting(self) -> Image:
        """Share (H, W) of the light that arrives: cos(field angle)^VIGNETTING_POWER."""
        return np.asarray(self.length**-VIGNETTING_POWER, np.float32)


@lru_cache(maxsize=4)
def lens_of(model: CameraModel) -> Lens:
    """The lens of a camera model; it is worked out once."""
    rays = np.empty((model.height, model.width, 2), np.float32)
    step = max(1, _BAND_PX // model.width)
    columns = np.arange(model.width, dtype=np.float64)
    for row in range(0, model.height, step):
        rows = np.arange(row, min(row + step, model.height), dtype=np.float64)
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
        rays[row : row + step] = model.rays(pixels)[..., :2]
    length = np.sqrt(1 + rays[..., 0] ** 2 + rays[..., 1] ** 2)
    return Lens(model, rays, length, _jacobian(model, rays))


def _jacobian(model: CameraModel, rays: Image) -> Image:
    """Derivative of `CameraModel.distort`, times the focal lengths."""
    x, y = rays[..., 0], rays[..., 1]
    k1, k2, p1, p2, k3 = (np.float32(k) for k in model.distortion)
    squared = x * x + y * y
    radial = 1 + squared * (k1 + squared * (k2 + squared * k3))
    slope = 2 * (k1 + squared * (2 * k2 + squared * 3 * k3))
    mixed = x * y * slope + 2 * p1 * x + 2 * p2 * y
    across = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
    down = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
    fx, fy = np.float32(model.fx), np.float32(model.fy)
    return np.stack([fx * across, fx * mixed, fy * mixed, fy * down], axis=-1)
