"""The evaluated pixels of a frame: where its ground truth falls in the original left image."""

import threading
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel, rasterize
from card.geometry.camera import UNDISTORT_ITERATIONS, UNDISTORT_TOLERANCE

Array = NDArray[np.float64]
Pixels = NDArray[np.int64]

ROWS_AT_ONCE = 64


@dataclass(frozen=True)
class View:
    """A camera whose frames are evaluated one after the other; keeps what all of them share."""

    camera: CameraModel
    _own: threading.local = field(default_factory=threading.local, repr=False, compare=False)

    @cached_property
    def rays(self) -> Array:
        """(H*W, 2): x and y of the ray with z = 1 through each pixel of the original image."""
        kernels, c = compiled(), self.camera
        if kernels is not None:
            pinhole = (c.fx, c.fy, c.cx, c.cy)
            found, step = kernels.pixel_rays(
                c.width, c.height, pinhole, c.distortion, UNDISTORT_ITERATIONS, UNDISTORT_TOLERANCE
            )
            if step < UNDISTORT_TOLERANCE:
                return np.asarray(found)
        return self.plain_rays()

    def plain_rays(self) -> Array:
        """The same by the camera model alone; it also says where the distortion cannot be inverted."""
        rays = np.empty((self.camera.height, self.camera.width, 2))
        for top in range(0, self.camera.height, ROWS_AT_ONCE):
            block = rays[top : top + ROWS_AT_ONCE]
            v, u = np.mgrid[top : top + len(block), : self.camera.width]
            block[:] = self.camera.rays(np.stack([u, v], axis=-1))[..., :2]
        return rays.reshape(-1, 2)

    @property
    def scratch(self) -> NDArray[np.float32]:
        """(H*W,) inf: the depth buffer that the compiled form borrows, one a thread."""
        if not hasattr(self._own, "depth"):
            self._own.depth = np.full(self.camera.width * self.camera.height, np.inf, dtype=np.float32)
        depth: NDArray[np.float32] = self._own.depth
        return depth

    def truth(
        self, points: NDArray[np.float32], limits: tuple[float, float], plain: bool = False
    ) -> tuple[Pixels, Array]:
        """Flat pixels (M,) with ground truth within the limits, and its depth (M,), metres.

        points : (N, 3) in camera_left. A pixel takes the nearest z of the points that round to it. The
        prediction has no say in what is evaluated, so that a method cannot improve by failing.
        plain : take the plain form even if the compiled one is there; it gives the pixels in another order.
        """
        kernels = None if plain else compiled()
        if kernels is None:
            depth = rasterize(points, self.camera).ravel()
            pixels = np.flatnonzero(np.isfinite(depth))
            nearest = depth[pixels]
        else:
            c = self.camera
            pixels, nearest = kernels.nearest_points(
                np.ascontiguousarray(points, dtype=np.float32),
                (c.fx, c.fy, c.cx, c.cy),
                c.distortion,
                c.max_radius**2,
                c.width,
                c.height,
                self.scratch,
            )
        inside = (nearest >= limits[0]) & (nearest <= limits[1])
        return (pixels, nearest) if inside.all() else (pixels[inside], nearest[inside])


def compiled() -> Any:
    """The module of compiled forms; None where numba is not installed."""
    try:
        from card.benchmark import kernels
    except ImportError:
        return None
    return kernels
