"""What the calibration of the front LiDAR says: the document, its quality figures and its verdict."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from card.artifacts import Figure
from card.calibration.camera_document import pose_sigmas
from card.calibration.camera_estimate import view_mean_squares
from card.calibration.corner_residuals import skew
from card.calibration.lidar_estimate import FrontLidar
from card.calibration.state import (
    CORRECTIONS,
    INTRINSICS,
    LIDAR,
    STEREO,
    Array,
    State,
    corrections_document,
    step_between,
)
from card.calibration.verdict import Limit, verdict
from card.geometry import to_json


def lidar_document(found: FrontLidar, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The document of schema ``front_lidar_calibration``."""
    solution = found.solution
    state, covariance, across = solution.state, solution.covariance, solution.residuals[-1]
    distance = across * found.cosine
    present = np.isfinite(distance)
    inliers = solution.inliers(2, settings["huber_sigmas"])
    closed = step_between(state.lidar_from_left, found.closed_form)
    quality = {
        "views": int(sum(not reason for reason in found.reasons)),
        "views_refused": int(sum(bool(reason) for reason in found.reasons)),
        "returns": int(present.sum()),
        "inliers": int(inliers.sum()),
        "board_plane_rms_m": float(np.sqrt(np.mean(np.square(distance[present])))),
        "range_sigma_m": solution.sigmas[2],
        "reprojection_rms_px": float(
            np.sqrt(np.mean([view_mean_squares(r) for r in solution.residuals[:2]]))
        ),
        "corner_sigma_px": float(np.sqrt(np.mean(np.square(solution.sigmas[:2])))),
        "split_half_deg": _deg(found.half_step),
        "split_half_mm": _mm(found.half_step),
        "starts": found.starts,
        "starts_agreed": found.starts_agreed,
        "closed_form_deg": _deg(closed),
        "closed_form_mm": _mm(closed),
    }
    sigma_mm, sigma_deg = pose_sigmas(covariance[LIDAR, LIDAR])
    parts = {
        "camera_left": covariance[INTRINSICS[0], INTRINSICS[0]],
        "camera_right": covariance[INTRINSICS[1], INTRINSICS[1]],
        "left_from_right": covariance[STEREO, STEREO],
        "lidar_front_from_camera_left": covariance[LIDAR, LIDAR],
        "lidar_front_from_camera_right": right_covariance(state, covariance),
        "together": covariance[: LIDAR.stop, : LIDAR.stop],
    }
    return {
        "schema": "front_lidar_calibration",
        "cameras": {name: model.to_json() for name, model in state.cameras(*found.views.size).items()},
        "left_from_right": to_json(state.left_from_right),
        "lidar_front_from_camera_left": to_json(state.lidar_from_left),
        "lidar_front_from_camera_right": to_json(state.lidar_from_left @ state.left_from_right),
        "corrections": state.correction_document(),
        "sigmas": corrections_document(np.sqrt(np.diag(covariance)[CORRECTIONS])),
        "covariances": {name: part.tolist() for name, part in parts.items()},
        "views": [
            {
                "view": name,
                "t_ns": int(found.views.t_ns[i]),
                "used": not found.reasons[i],
                "reason": found.reasons[i],
                "returns": int(present[i].sum()),
                "inliers": int(inliers[i].sum()),
                "plane_rms_m": float(np.sqrt(np.mean(np.square(distance[i, present[i]]))))
                if present[i].any()
                else None,
            }
            for i, name in enumerate(found.views.names)
        ],
        "quality": quality,
        "verdict": verdict(
            Limit("board_plane_rms_m", quality["board_plane_rms_m"], settings["max_plane_rms_m"]),
            Limit("lidar_sigma_deg", sigma_deg, settings["max_sigma_deg"]),
            Limit("lidar_sigma_mm", sigma_mm, settings["max_sigma_mm"]),
            Limit("starts_disagreed", found.starts - found.starts_agreed, found.starts // 2),
        ),
    }


def right_covariance(state: State, covariance: Array) -> Array:
    """Covariance (6, 6) of the right camera in the LiDAR, by way of the left one, which correlates them."""
    turn = state.lidar_from_left[:3, :3]
    by_lidar, by_stereo = np.eye(6), np.zeros((6, 6))
    by_lidar[:3, 3:] = -skew(turn @ state.left_from_right[:3, 3])
    by_stereo[:3, :3] = by_stereo[3:, 3:] = turn
    both = np.concatenate([by_lidar, by_stereo], axis=1)
    columns = np.r_[LIDAR, STEREO]
    return np.asarray(both @ covariance[np.ix_(columns, columns)] @ both.T)


def figures_of(document: Mapping[str, Any]) -> list[Figure]:
    """The report's figures of a document."""
    quality = document["quality"]
    sigma_mm, sigma_deg = pose_sigmas(np.array(document["covariances"]["lidar_front_from_camera_left"]))
    return [
        Figure(
            "board_plane_rms_mm",
            1e3 * quality["board_plane_rms_m"],
            "mm",
            "RMS distance of board returns to the board planes",
        ),
        Figure("front_lidar_sigma_deg", sigma_deg, "deg", "standard deviation of the LiDAR's rotation"),
        Figure("front_lidar_sigma_mm", sigma_mm, "mm", "standard deviation of the LiDAR's position"),
        Figure("split_half_deg", quality["split_half_deg"], "deg", "angle between the poses of two halves"),
        Figure("split_half_mm", quality["split_half_mm"], "mm", "distance between the poses of two halves"),
        Figure(
            "starts_agreed_pct",
            100 * quality["starts_agreed"] / quality["starts"],
            "%",
            "starting poses that led to the best one's pose",
        ),
        Figure("closed_form_deg", quality["closed_form_deg"], "deg", "rotation against the closed form"),
        Figure("closed_form_mm", quality["closed_form_mm"], "mm", "position against the closed form"),
        Figure("front_lidar_passed", float(document["verdict"]["passed"]), "1", "whether every limit holds"),
    ]


def _deg(step: Array) -> float:
    return float(np.degrees(np.linalg.norm(step[3:])))


def _mm(step: Array) -> float:
    return 1e3 * float(np.linalg.norm(step[:3]))
