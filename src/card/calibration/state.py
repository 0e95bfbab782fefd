"""The unknowns of a session: cameras, their pose to each other, the LiDAR and its corrections, the boards."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.geometry import CameraModel

Array = NDArray[np.float64]

CHANNELS = 32
#: Columns of the shared unknowns, those that all views have in common.
INTRINSICS = (slice(0, 9), slice(9, 18))
STEREO = slice(18, 24)
LIDAR = slice(24, 30)
RANGE = slice(30, 31)
CHANNEL_RANGE = slice(31, 63)
ELEVATION = slice(63, 95)
AZIMUTH = slice(95, 127)
CORRECTIONS = slice(30, 127)
SHARED = 127


@dataclass(frozen=True)
class State:
    """One value of all unknowns.

    intrinsics : (2, 9) of the left and the right camera: fx, fy, cx, cy (px), k1, k2, p1, p2, k3.
    left_from_right, lidar_from_left : (4, 4).
    corrections : (97,) range offset (m), then a channel each: range (m), elevation, azimuth (rad).
    left_from_board : (V, 4, 4), the board in each view.
    """

    intrinsics: Array
    left_from_right: Array
    lidar_from_left: Array
    corrections: Array
    left_from_board: Array

    def moved(self, shared: Array, poses: Array) -> "State":
        """The state after a step of the shared unknowns (127,) and of the board poses (V, 6).

        A pose a_from_b takes a translation, then a rotation vector, both in a: t + dt, exp(w) R.
        """
        return State(
            self.intrinsics + np.stack([shared[columns] for columns in INTRINSICS]),
            moved(self.left_from_right, shared[STEREO]),
            moved(self.lidar_from_left, shared[LIDAR]),
            self.corrections + shared[CORRECTIONS],
            moved(self.left_from_board, poses),
        )

    def of_views(self, chosen: NDArray[Any]) -> "State":
        """The state with only some of the views, by index or mask."""
        return replace(self, left_from_board=self.left_from_board[chosen])

    def cameras(self, width: int, height: int) -> dict[str, CameraModel]:
        """The camera models, for images of a size in px."""
        return {
            name: camera_model(row, width, height)
            for name, row in zip(("camera_left", "camera_right"), self.intrinsics, strict=True)
        }

    def correction_document(self) -> dict[str, Any]:
        """The corrections in the form of the calibration's ``lidar_corrections``."""
        return corrections_document(self.corrections)


def moved(a_from_b: Array, step: Array) -> Array:
    """Poses (..., 4, 4) after steps (..., 6) in a: translation (m), then rotation vector (rad)."""
    result = np.array(a_from_b)
    result[..., :3, 3] += step[..., :3]
    turn = Rotation.from_rotvec(step[..., 3:].reshape(-1, 3)).as_matrix().reshape(*step.shape[:-1], 3, 3)
    result[..., :3, :3] = turn @ a_from_b[..., :3, :3]
    return result


def step_between(a_from_b: Array, other: Array) -> Array:
    """The step (6,) that moves the first pose (4, 4) to the other."""
    turn = Rotation.from_matrix(other[:3, :3] @ a_from_b[:3, :3].T).as_rotvec()
    return np.concatenate([other[:3, 3] - a_from_b[:3, 3], turn])


def camera_model(row: Array, width: int, height: int) -> CameraModel:
    """The model of one row (9,) of intrinsics."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(value) for value in row)
    return CameraModel(width, height, fx, fy, cx, cy, (k1, k2, p1, p2, k3))


def intrinsics_of(camera: CameraModel) -> Array:
    """The row (9,) of a camera model."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])


def corrections_document(values: Array) -> dict[str, Any]:
    """Corrections (97,) in the form of the calibration's ``lidar_corrections``."""
    return {
        "range_offset_m": float(values[0]),
        "channel_range_offset_m": values[1:33].tolist(),
        "channel_elevation_offset_rad": values[33:65].tolist(),
        "channel_azimuth_offset_rad": values[65:97].tolist(),
    }
