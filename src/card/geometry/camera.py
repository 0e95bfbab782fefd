"""Pinhole camera with Brown's distortion (k1, k2, p1, p2, k3), pixel centres at integers.

D. C. Brown, "Close-Range Camera Calibration", Photogrammetric Engineering, 1971; OpenCV's parameter order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.errors import CardError

Array = NDArray[np.float64]
UNDISTORT_ITERATIONS = 50
UNDISTORT_TOLERANCE = 1e-12


@dataclass(frozen=True)
class CameraModel:
    """Intrinsics of one camera: size in pixels, focal lengths and principal point in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def K(self) -> Array:
        """Camera matrix (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], dtype=np.float64)

    def undistorted(self) -> "CameraModel":
        """The same pinhole without distortion."""
        return CameraModel(self.width, self.height, self.fx, self.fy, self.cx, self.cy)

    def distort(self, normalized: ArrayLike) -> Array:
        """Distorted normalised coordinates (..., 2) of undistorted ones (..., 2)."""
        x, y = np.moveaxis(np.asarray(normalized, dtype=np.float64), -1, 0)
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.stack([xd, yd], axis=-1)

    def project(self, points: ArrayLike) -> Array:
        """Pixels (N, 2) of points (N, 3) in the camera frame, metres.

        NaN where z <= 0 and beyond the radius at which the distortion folds the image back onto itself.
        """
        p = np.asarray(points, dtype=np.float64)
        front = p[..., 2:] > 0
        normalized = np.where(front, p[..., :2], np.nan) / np.where(front, p[..., 2:], 1.0)
        folded = np.sum(normalized**2, axis=-1, keepdims=True) >= self.max_radius**2
        return self.distort(np.where(folded, np.nan, normalized)) * (self.fx, self.fy) + (self.cx, self.cy)

    @cached_property
    def max_radius(self) -> float:
        """Normalised radius up to which r (1 + k1 r^2 + k2 r^4 + k3 r^6) grows."""
        k1, k2, _, _, k3 = self.distortion
        squared = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
        turns = [root.real for root in squared if abs(root.imag) < 1e-9 and root.real > 0]
        return float(np.sqrt(min(turns, default=np.inf)))

    def rays(self, pixels: ArrayLike) -> Array:
        """Ray directions (..., 3) with z = 1 of pixels (..., 2): the inverse of `project`.

        Raises
        ------
        CardError
            If the distortion cannot be inverted at a pixel.
        """
        uv = np.asarray(pixels, dtype=np.float64)
        wanted = (uv - (self.cx, self.cy)) / (self.fx, self.fy)
        xy = wanted.copy()
        residual = np.zeros(0)
        for _ in range(UNDISTORT_ITERATIONS):
            step = wanted - self.distort(xy)
            xy += step
            residual = np.abs(step)
            if residual.size == 0 or residual.max() < UNDISTORT_TOLERANCE:
                break
        if residual.size and not residual.max() < 1e-6:
            raise CardError(
                "distortion cannot be inverted", found=f"residual {residual.max():.2g}", wanted="< 1e-6"
            )
        return np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)

    def contains(self, pixels: ArrayLike) -> NDArray[np.bool_]:
        """Whether pixels (..., 2) fall on the image: [-0.5, width - 0.5) by [-0.5, height - 0.5)."""
        u, v = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
        return (u >= -0.5) & (u < self.width - 0.5) & (v >= -0.5) & (v < self.height - 0.5)

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> "CameraModel":
        """The model of its document form; without ``distortion`` there is none."""
        k1, k2, p1, p2, k3 = (float(v) for v in document.get("distortion", (0.0,) * 5))
        return cls(
            width=int(document["width"]),
            height=int(document["height"]),
            fx=float(document["fx"]),
            fy=float(document["fy"]),
            cx=float(document["cx"]),
            cy=float(document["cy"]),
            distortion=(k1, k2, p1, p2, k3),
        )

    def to_json(self) -> dict[str, Any]:
        """The document form used in ``calibration.json``."""
        pinhole = {name: getattr(self, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
        return {**pinhole, "model": "brown5", "distortion": list(self.distortion)}
