"""Board corners in the images of a camera: where they are against where they are projected to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.calibration.residuals import Linear
from card.calibration.state import INTRINSICS, STEREO, State, camera_model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corners:
    """Corners in the images of one camera.

    side : 0 for the left one, 1 for the right one.
    board : (N, 3) in the board frame, metres.
    pixels : (V, N, 2).
    """

    side: int
    board: Array
    pixels: Array

    @property
    def columns(self) -> NDArray[np.intp]:
        own = np.arange(INTRINSICS[self.side].start, INTRINSICS[self.side].stop)
        return np.concatenate([own, np.arange(STEREO.start, STEREO.stop)]) if self.side else own

    def residual(self, state: State) -> Array:
        projected = _project(state.intrinsics[self.side], self._in_camera(state)[1])
        return np.asarray(projected - self.pixels).reshape(len(self.pixels), -1)

    def linear(self, state: State) -> Linear:
        turned, points = self._in_camera(state)
        values = state.intrinsics[self.side]
        by_point, by_intrinsics = project_derivatives(values, points)
        # In the left camera: p = exp(w) R c + t + dt.
        camera_from_left = state.left_from_right[:3, :3].T if self.side else np.eye(3)
        by_left = by_point @ camera_from_left
        by_pose = np.concatenate([by_left, -by_left @ skew(turned)], axis=-1)
        shared = by_intrinsics
        if self.side:
            # q = R' exp(-w) (p - t - dt).
            arm = (turned + state.left_from_board[:, None, :3, 3]) - state.left_from_right[:3, 3]
            by_stereo = np.concatenate([-by_left, by_left @ skew(arm)], axis=-1)
            shared = np.concatenate([shared, by_stereo], axis=-1)
        views = len(self.pixels)
        residual = (_project(values, points) - self.pixels).reshape(views, -1)
        return Linear(residual, shared.reshape(views, -1, shared.shape[-1]), by_pose.reshape(views, -1, 6))

    def _in_camera(self, state: State) -> tuple[Array, Array]:
        """Corners turned into the left camera but not yet shifted, and in this camera: (V, N, 3) each."""
        turned = self.board @ np.swapaxes(state.left_from_board[:, :3, :3], 1, 2)
        points = turned + state.left_from_board[:, None, :3, 3]
        if self.side:
            points = (points - state.left_from_right[:3, 3]) @ state.left_from_right[:3, :3]
        return turned, points


def project_derivatives(values: Array, points: Array) -> tuple[Array, Array]:
    """Derivatives of pixels by the point (..., 2, 3) and by the intrinsics (..., 2, 9) of one camera."""
    fx, fy, _, _, k1, k2, p1, p2, k3 = values
    inverse_z = 1 / points[..., 2]
    x, y = points[..., 0] * inverse_z, points[..., 1] * inverse_z
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))  # radial by x is slope times x
    xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    xy = slope * x * y + 2 * p1 * x + 2 * p2 * y
    yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    by_point = (
        np.stack(
            [
                np.stack([fx * xx, fx * xy, -fx * (xx * x + xy * y)], axis=-1),
                np.stack([fy * xy, fy * yy, -fy * (xy * x + yy * y)], axis=-1),
            ],
            axis=-2,
        )
        * inverse_z[..., None, None]
    )
    xd, yd = np.moveaxis(camera_model(values, 1, 1).distort(np.stack([x, y], axis=-1)), -1, 0)
    zero, one = np.zeros_like(x), np.ones_like(x)
    by_u = [
        xd,
        zero,
        one,
        zero,
        fx * x * r2,
        fx * x * r2**2,
        fx * 2 * x * y,
        fx * (r2 + 2 * x * x),
        fx * x * r2**3,
    ]
    by_v = [
        zero,
        yd,
        zero,
        one,
        fy * y * r2,
        fy * y * r2**2,
        fy * (r2 + 2 * y * y),
        fy * 2 * x * y,
        fy * y * r2**3,
    ]
    return by_point, np.stack([np.stack(by_u, axis=-1), np.stack(by_v, axis=-1)], axis=-2)


def _project(values: Array, points: Array) -> Array:
    """Pixels (..., 2); as `CameraModel.project`, without its limits, which an iteration may cross."""
    distorted = camera_model(values, 1, 1).distort(points[..., :2] / points[..., 2:])
    return np.asarray(distorted * values[:2] + values[2:4])


def skew(vectors: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product by vectors (..., 3) from the left."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=-2)
