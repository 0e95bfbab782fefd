"""The estimate of both cameras over the board views of a session."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.calibration.board import Board
from card.calibration.board_views import BoardViews
from card.calibration.camera_checks import agreeing_pairs, check_count, check_coverage, check_tilt
from card.calibration.camera_start import camera_from_board, start_intrinsics
from card.calibration.corner_residuals import Corners
from card.calibration.robust_least_squares import Problem, Solution, solve
from card.calibration.state import Array, State
from card.geometry import inverse

#: The first shared unknowns: both intrinsics and the stereo pose.
CAMERA_COLUMNS = np.arange(24)


@dataclass(frozen=True)
class Cameras:
    """What came of the board views: the solution of the used ones, and why each other one is not used.

    used : (V,) which views of ``views`` the solution has, in order.  reasons : a view, empty where used.
    """

    views: BoardViews
    used: NDArray[np.bool_]
    reasons: tuple[str, ...]
    solution: Solution


def estimate_cameras(views: BoardViews, board: Board, settings: Mapping[str, Any], where: object) -> Cameras:
    """The cameras of views; settings : section ``cameras`` of the stage's settings."""
    check_count(views, settings, where)
    check_coverage(views, settings, where)
    intrinsics = start_intrinsics(views, board, settings["start_views"])
    left, right = (
        camera_from_board(pixels, board, row) for pixels, row in zip(views.pixels, intrinsics, strict=True)
    )
    agreed = agreeing_pairs(views, left, right, settings, where)
    check_tilt(views, left, settings, where)
    reasons = np.where(agreed, "", "its images do not agree on the stereo pose of the others").astype(object)
    check_count(views.of(agreed), settings, where)
    pairs = (left @ inverse(right))[agreed]
    stereo = np.eye(4)
    stereo[:3, :3] = Rotation.from_matrix(pairs[:, :3, :3]).mean().as_matrix()
    stereo[:3, 3] = np.median(pairs[:, :3, 3], axis=0)
    start = State(intrinsics, stereo, np.eye(4), np.zeros(97), left[agreed])
    solution = solve(start, camera_problem(views.of(agreed), board, settings))
    error = np.median(np.concatenate([_lengths(r) for r in solution.residuals], axis=1), axis=1)
    bad = error > settings["max_view_error_px"]
    if bad.any():
        reasons[np.flatnonzero(agreed)[bad]] = [f"median reprojection error {e:.2f} px" for e in error[bad]]
        used = np.array([not reason for reason in reasons])
        check_count(views.of(used), settings, where)
        start = replace(solution.state.of_views(~bad), left_from_board=left[used])
        solution = solve(start, camera_problem(views.of(used), board, settings))
    return Cameras(views, np.array([not reason for reason in reasons]), tuple(reasons), solution)


def camera_problem(views: BoardViews, board: Board, settings: Mapping[str, Any]) -> Problem:
    """Reprojection of the corners of views into both cameras."""
    return Problem(
        blocks=[Corners(side, board.corners_m, views.pixels[side]) for side in range(2)],
        sigmas=[settings["corner_sigma_px"]] * 2,
        free=CAMERA_COLUMNS,
        huber=settings["huber_sigmas"],
        prior_sigma=np.ones(97),
    )


def _lengths(residual: Array) -> Array:
    """Distances (V, N) between corners, of residuals (V, 2 N)."""
    return np.asarray(np.linalg.norm(residual.reshape(len(residual), -1, 2), axis=2))


def view_mean_squares(residual: Array) -> Array:
    """Mean squared reprojection error (V,) of residuals (V, 2 N), px^2: of both coordinates together."""
    return 2 * np.mean(np.square(residual), axis=1)
