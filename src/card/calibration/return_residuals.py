"""Returns of a LiDAR on the board: how far along its ray each is off the board's plane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.calibration.residuals import Linear
from card.calibration.state import CHANNELS, LIDAR, State
from card.geometry.corrections import correct_points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BoardReturns:
    """Returns of the LiDAR on the boards: how far along its ray each is off the plane.

    points : (V, M, 3) as measured, in the LiDAR frame; NaN where a view has fewer.
    ring : (V, M) channel.
    cosine : (V, M) of incidence: a range's error counts by so much across the plane.
    """

    points: Array
    ring: NDArray[np.uint8]
    cosine: Array

    @property
    def columns(self) -> NDArray[np.intp]:
        return np.arange(LIDAR.start, LIDAR.stop + 1 + 3 * CHANNELS)

    def residual(self, state: State) -> Array:
        return self._distance(state)[0] / self.cosine

    def linear(self, state: State) -> Linear:
        distance, normal, arm, points = self._distance(state)
        to_left = state.lidar_from_left[:3, :3].T
        in_lidar = normal @ to_left  # the normal in the LiDAR, (V, 3)
        views, count = distance.shape
        shared = np.zeros((views, count, 6 + 1 + 3 * CHANNELS))
        shared[..., :3] = -in_lidar[:, None]
        # p = R' exp(-w) (q - t - dt).
        shared[..., 3:6] = np.cross(in_lidar[:, None], points - state.lidar_from_left[:3, 3])
        by_range, by_elevation, by_azimuth = (
            np.einsum("vi,vmi->vm", in_lidar, direction) for direction in _sensor_directions(points)
        )
        shared[..., 6] = by_range
        own = np.arange(CHANNELS) == self.ring[..., None]
        for number, derivative in enumerate((by_range, by_elevation, by_azimuth)):
            first = 7 + number * CHANNELS
            shared[..., first : first + CHANNELS] = own * derivative[..., None]
        pose = np.concatenate(
            [np.broadcast_to(-normal[:, None], (views, count, 3)), np.cross(normal[:, None], arm)], axis=-1
        )
        scale = 1 / self.cosine[..., None]
        return Linear(distance / self.cosine, shared * scale, pose * scale)

    def _distance(self, state: State) -> tuple[Array, Array, Array, Array]:
        """Distances (V, M) to the planes, their normals (V, 3) in the left camera, arms (V, M, 3) from the
        boards' origins, corrected points (V, M, 3)."""
        flat = correct_points(self.points.reshape(-1, 3), self.ring.ravel(), state.correction_document())
        points = flat.reshape(self.points.shape)
        left = (points - state.lidar_from_left[:3, 3]) @ state.lidar_from_left[:3, :3]
        normal = state.left_from_board[:, :3, 2]
        arm = left - state.left_from_board[:, None, :3, 3]
        return np.einsum("vi,vmi->vm", normal, arm), normal, arm, points


def _sensor_directions(points: Array) -> tuple[Array, Array, Array]:
    """Where points (..., 3) move by range, elevation and azimuth (clockwise) of the LiDAR: (..., 3) each."""
    x, y, z = np.moveaxis(points, -1, 0)
    flat = np.hypot(x, y)
    by_range = points / np.linalg.norm(points, axis=-1, keepdims=True)
    by_elevation = np.stack([-z * x / flat, -z * y / flat, flat], axis=-1)
    return by_range, by_elevation, np.stack([y, -x, np.zeros_like(x)], axis=-1)
