"""The pose of the board from the images of both cameras."""

import cv2
import numpy as np
from numpy.typing import NDArray

from card.calibration.corner_residuals import Corners
from card.calibration.front_sensors import FrontSensors
from card.calibration.state import State, camera_model, moved

Array = NDArray[np.float64]

_STEPS = 10


def board_pose(
    sensors: FrontSensors, board: Array, pixels: Array, max_corner_px: float
) -> tuple[Array, NDArray[np.bool_]]:
    """``left_from_board`` (4, 4), and which corners (2, N) lie within a distance of it in the images, px.

    A flat target has two poses in one image (T. Collins and A. Bartoli, "Infinitesimal Plane-Based Pose
    Estimation", IJCV 2014); the other camera decides between them, and both refine it, with weights that keep
    single wrong corners (Huber's) from moving it.

    board : (N, 3) corners in the board frame, metres.
    pixels : (2, N, 2) of the left and the right camera.
    """
    started = [pose for side in range(2) for pose in _seen_by(sensors, side, board, pixels[side])]
    pose = min(
        started, key=lambda pose: float(np.median(_sizes(_residuals(sensors, board, pixels, pose)[0])))
    )
    for _ in range(_STEPS):
        residual, jacobian = _residuals(sensors, board, pixels, pose)
        size = _sizes(residual)
        weight = np.minimum(1.0, np.median(size) / np.maximum(size, 1e-9)).repeat(2)
        step = np.linalg.lstsq(jacobian * weight[:, None], -residual * weight, rcond=None)[0]
        pose = moved(pose, np.asarray(step))
    size = _sizes(_residuals(sensors, board, pixels, pose)[0])
    return pose, np.asarray(size <= max_corner_px).reshape(2, -1)


def _sizes(residual: Array) -> Array:
    """Distance (2 N,) of each corner from where it is projected."""
    return np.asarray(np.linalg.norm(residual.reshape(-1, 2), axis=1))


def _seen_by(sensors: FrontSensors, side: int, board: Array, pixels: Array) -> list[Array]:
    # Rays of our own: OpenCV's stop short of them in the corners of an image.
    rays = np.ascontiguousarray(camera_model(sensors.intrinsics[side], 1, 1).rays(pixels)[:, :2])
    _, turns, shifts, _ = cv2.solvePnPGeneric(board, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    poses = []
    for turn, shift in zip(turns, shifts, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
        poses.append(sensors.left_from_right @ pose if side else pose)
    return poses


def _residuals(sensors: FrontSensors, board: Array, pixels: Array, pose: Array) -> tuple[Array, Array]:
    """Residuals (4 N,) px over both images, and their derivatives (4 N, 6) by a step of the pose."""
    state = State(sensors.intrinsics, sensors.left_from_right, np.eye(4), np.zeros(97), pose[None])
    linear = [Corners(side, board, pixels[side][None]).linear(state) for side in range(2)]
    return (
        np.concatenate([part.residual[0] for part in linear]),
        np.concatenate([part.pose[0] for part in linear]),
    )
