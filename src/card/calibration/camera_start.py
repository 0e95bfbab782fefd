"""Where the estimation of the cameras starts: OpenCV's calibration of each one, and what single views say."""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.calibration.board import Board
from card.calibration.board_views import BoardViews
from card.calibration.spread import spread
from card.calibration.state import Array, camera_model
from card.errors import CardError
from card.recording.paths import CAMERAS

# The cameras' model: Brown with five parameters, free focal lengths and principal point.
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-9)


def start_intrinsics(views: BoardViews, board: Board, most: int) -> Array:
    """Intrinsics (2, 9) of both cameras by OpenCV, of at most so many views."""
    cv2.setNumThreads(1)  # keeps sums in one order
    chosen = spread(len(views), most)
    corners = [board.corners_m.astype(np.float32)] * len(chosen)
    rows = []
    for camera, pixels in zip(CAMERAS, views.pixels, strict=True):
        try:
            _, matrix, distortion, _, _ = cv2.calibrateCamera(
                corners, list(pixels[chosen].astype(np.float32)), views.size, None, None, criteria=_STOP
            )
        except cv2.error as error:
            raise CardError(f"the views do not determine {camera}", found=error.err) from error
        (fx, _, cx), (_, fy, cy) = matrix[:2]
        rows.append([fx, fy, cx, cy, *distortion.ravel()[:5]])
    return np.array(rows)


def camera_from_board(pixels: Array, board: Board, intrinsics: Array) -> Array:
    """Pose (V, 4, 4) of the board in one camera, of the pixels (V, N, 2) of each view alone."""
    model = camera_model(intrinsics, 1, 1)
    poses = np.tile(np.eye(4), (len(pixels), 1, 1))
    for number, (pose, image) in enumerate(zip(poses, pixels, strict=True), 1):
        found, turn, shift = cv2.solvePnP(board.corners_m, image, model.K, np.array(model.distortion))
        if not found:
            raise CardError("no pose of the board fits its corners", found=f"view {number} of {len(pixels)}")
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
    return poses


def agreement(poses: Array, settings: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Which of V stereo poses (V, 4, 4), one a view, agree with the one that most agree with: (V,)."""
    turns = poses[:, :3, :3].reshape(-1, 9)
    cosine = np.clip((turns @ turns.T - 1) / 2, -1, 1)
    apart = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1)
    alike = cosine >= np.cos(np.radians(settings["max_pair_angle_deg"]))
    alike &= apart <= settings["max_pair_distance_m"]
    return np.asarray(alike[int(np.argmax(alike.sum(axis=1)))])


def opencv_stereo(views: BoardViews, board: Board, intrinsics: Array, most: int) -> Array:
    """``left_from_right`` (4, 4) by OpenCV with these intrinsics, of at most so many views."""
    cv2.setNumThreads(1)
    chosen = spread(len(views), most)
    models = [camera_model(row, *views.size) for row in intrinsics]
    left, right = (list(pixels[chosen].astype(np.float32)) for pixels in views.pixels)
    _, *_, rotation, shift, _, _ = cv2.stereoCalibrate(
        [board.corners_m.astype(np.float32)] * len(chosen),
        left,
        right,
        models[0].K,
        np.array(models[0].distortion),
        models[1].K,
        np.array(models[1].distortion),
        views.size,
        flags=cv2.CALIB_FIX_INTRINSIC,
        criteria=_STOP,
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ shift[:, 0]
    return pose
