"""What the camera calibration says: the document, its quality figures and its verdict."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.calibration.board import Board
from card.calibration.camera_checks import coverage_pct, tilts_deg
from card.calibration.camera_estimate import Cameras
from card.calibration.camera_start import opencv_stereo
from card.calibration.state import INTRINSICS, STEREO, step_between
from card.calibration.verdict import Limit, verdict
from card.geometry import to_json


def camera_document(found: Cameras, board: Board, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The document of schema ``camera_calibration``."""
    used, solution = found.views.of(found.used), found.solution
    state = solution.state
    squares = [np.square(residual).reshape(len(used), -1, 2).sum(axis=2) for residual in solution.residuals]
    inliers = [
        solution.inliers(side, settings["huber_sigmas"]).reshape(len(used), -1, 2).all(axis=2)
        for side in range(2)
    ]
    witness = step_between(
        state.left_from_right, opencv_stereo(used, board, state.intrinsics, settings["start_views"])
    )
    depth = state.left_from_board[:, 2, 3]
    quality = {
        "views": len(used),
        "views_refused": len(found.views) - len(used),
        "corners": int(sum(part.size for part in squares)),
        "inliers": int(sum(part.sum() for part in inliers)),
        "reprojection_rms_px": float(np.sqrt(np.mean(squares))),
        "corner_sigma_px": float(np.sqrt(np.mean(np.square(solution.sigmas)))),
        "coverage_left_pct": coverage_pct(used.pixels[0], used.size),
        "coverage_right_pct": coverage_pct(used.pixels[1], used.size),
        "tilt_deg": float(np.percentile(tilts_deg(state.left_from_board), 90)),
        "nearest_m": float(depth.min()),
        "farthest_m": float(depth.max()),
        "opencv_angle_deg": float(np.degrees(np.linalg.norm(witness[3:]))),
        "opencv_distance_mm": 1e3 * float(np.linalg.norm(witness[:3])),
    }
    left, right, stereo = (solution.covariance[part, part] for part in (*INTRINSICS, STEREO))
    sigma_mm, sigma_deg = pose_sigmas(stereo)
    return {
        "schema": "camera_calibration",
        "cameras": {name: model.to_json() for name, model in state.cameras(*used.size).items()},
        "left_from_right": to_json(state.left_from_right),
        "covariances": {
            "camera_left": left.tolist(),
            "camera_right": right.tolist(),
            "left_from_right": stereo.tolist(),
        },
        "views": _views(found, squares, inliers),
        "quality": quality,
        "verdict": verdict(
            Limit("reprojection_rms_px", quality["reprojection_rms_px"], settings["max_reprojection_rms_px"]),
            Limit("stereo_sigma_deg", sigma_deg, settings["max_stereo_sigma_deg"]),
            Limit("stereo_sigma_mm", sigma_mm, settings["max_stereo_sigma_mm"]),
        ),
    }


def pose_sigmas(covariance: NDArray[np.float64]) -> tuple[float, float]:
    """Standard deviation of a pose's position (mm) and of its rotation (deg), over all axes together."""
    return (
        1e3 * float(np.sqrt(np.trace(covariance[:3, :3]))),
        float(np.degrees(np.sqrt(np.trace(covariance[3:, 3:])))),
    )


def figures_of(document: Mapping[str, Any]) -> list[Figure]:
    """The report's figures of a document."""
    quality = document["quality"]
    sigma_mm, sigma_deg = pose_sigmas(np.array(document["covariances"]["left_from_right"]))
    return [
        Figure("stereo_reprojection_px", quality["reprojection_rms_px"], "px", "RMS reprojection error"),
        Figure("stereo_sigma_deg", sigma_deg, "deg", "standard deviation of the stereo rotation"),
        Figure("stereo_sigma_mm", sigma_mm, "mm", "standard deviation of the stereo baseline"),
        Figure(
            "coverage_left_pct", quality["coverage_left_pct"], "%", "cells of the left image with a corner"
        ),
        Figure(
            "coverage_right_pct", quality["coverage_right_pct"], "%", "cells of the right image with a corner"
        ),
        Figure(
            "board_tilt_deg", quality["tilt_deg"], "deg", "lean of the board that a tenth of the views exceed"
        ),
        Figure("opencv_angle_deg", quality["opencv_angle_deg"], "deg", "stereo rotation against OpenCV's"),
        Figure("opencv_distance_mm", quality["opencv_distance_mm"], "mm", "stereo baseline against OpenCV's"),
        Figure("cameras_passed", float(document["verdict"]["passed"]), "1", "whether every limit holds"),
    ]


def _views(found: Cameras, squares: list[Any], inliers: list[Any]) -> list[dict[str, Any]]:
    rows, ordinal = [], np.cumsum(found.used) - 1
    for number, (name, reason) in enumerate(zip(found.views.names, found.reasons, strict=True)):
        i = int(ordinal[number]) if found.used[number] else None
        left, right = (None, None) if i is None else (float(np.sqrt(part[i].mean())) for part in squares)
        rows.append(
            {
                "view": name,
                "t_ns": int(found.views.t_ns[number]),
                "used": i is not None,
                "reason": reason,
                "left_from_board": None if i is None else to_json(found.solution.state.left_from_board[i]),
                "rms_left_px": left,
                "rms_right_px": right,
                "corners": 2 * found.views.pixels.shape[2],
                "inliers": 0 if i is None else int(sum(part[i].sum() for part in inliers)),
            }
        )
    return rows
