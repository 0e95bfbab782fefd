"""The pose of the board from the images of both cameras, to start from."""

import cv2
import numpy as np
from numpy.typing import NDArray

from card.calibration.corner_residuals import Corners
from card.calibration.front_sensors import FrontSensors
from card.calibration.state import State

Array = NDArray[np.float64]


def board_pose(sensors: FrontSensors, board: Array, pixels: Array) -> tuple[Array, float]:
    """``left_from_board`` (4, 4) and its RMS reprojection error over both images, px.

    A flat target has two poses in one image (T. Collins and A. Bartoli, "Infinitesimal Plane-Based Pose
    Estimation", IJCV 2014); the other camera decides between them.

    board : (N, 3) corners in the board frame, metres.
    pixels : (2, N, 2) of the left and the right camera; NaN where one does not see the board.
    """
    poses = [pose for side in range(2) for pose in _seen_by(sensors, side, board, pixels[side])]
    errors = [_rms(sensors, board, pixels, pose) for pose in poses]
    best = int(np.argmin(errors))
    return poses[best], errors[best]


def _seen_by(sensors: FrontSensors, side: int, board: Array, pixels: Array) -> list[Array]:
    if not np.isfinite(pixels).all():
        return []
    fx, fy, cx, cy, *distortion = sensors.intrinsics[side]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    _, turns, shifts, _ = cv2.solvePnPGeneric(
        board, pixels, matrix, np.array(distortion), flags=cv2.SOLVEPNP_IPPE
    )
    poses = []
    for turn, shift in zip(turns, shifts, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
        poses.append(sensors.left_from_right @ pose if side else pose)
    return poses


def _rms(sensors: FrontSensors, board: Array, pixels: Array, pose: Array) -> float:
    state = State(sensors.intrinsics, sensors.left_from_right, np.eye(4), np.zeros(97), pose[None])
    off = [Corners(side, board, pixels[side][None]).residual(state) for side in range(2)]
    return float(np.sqrt(2 * np.nanmean(np.square(off))))
