"""Cameras, board poses, front LiDAR and its corrections, in one estimate over a session."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import read_json, write_json, write_report
from card.calibration.board import Board
from card.calibration.board_views import read_board_views
from card.calibration.lidar_document import figures_of, lidar_document
from card.calibration.lidar_estimate import estimate_front_lidar
from card.calibration.lidar_start import Drawn, near_boards
from card.calibration.session_sweeps import sweeps_of
from card.calibration.state import CHANNELS, State, intrinsics_of
from card.errors import CardError
from card.geometry import CameraModel, from_json
from card.recording.paths import CAMERAS


def calibrate_front_lidar(
    *,
    session: Path,
    boards: Path,
    cameras: Path,
    board: Path,
    drawing: Path,
    front_lidar: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Estimate the front LiDAR with the cameras and write it as document `front_lidar_calibration`.

    Parameters
    ----------
    session : folder with lidar_front/<t_ns>.laz; a view uses the sweep during which its left image was taken.
    boards, cameras : table `board_detections` and document `camera_calibration` of the session.
    board : its board.yaml.
    drawing : document `drawing`, the car as drawn: where the board may roughly be.

    Raises
    ------
    CardError
        If too few views have returns of the board, naming one and what its returns are of.
    """
    pattern, found = Board.read(board), read_json(cameras, "camera_calibration")
    used = {view["view"]: view for view in found["views"] if view["used"]}
    views = read_board_views(boards, pattern)
    views = views.of(np.array([name in used for name in views.names]))
    if len(views) < len(used):
        raise CardError(
            "detections are not those of the camera calibration",
            where=boards,
            found=f"no view {sorted(set(used) - set(views.names))[0]}",
        )
    start = State(
        np.array([intrinsics_of(CameraModel.from_json(found["cameras"][name])) for name in CAMERAS]),
        from_json(found["left_from_right"]),
        np.eye(4),
        np.zeros(1 + 3 * CHANNELS),
        np.array([from_json(used[name]["left_from_board"]) for name in views.names]),
    )
    drawn = Drawn.of(read_json(drawing, "drawing"))
    sweeps = near_boards(sweeps_of(session, views.t_ns.tolist()), start.left_from_board, pattern, drawn)
    stated = {**settings["front_lidar"], "corner_sigma_px": found["quality"]["corner_sigma_px"]}
    estimate = estimate_front_lidar(views, list(sweeps), start, pattern, drawn, stated, session)
    document = lidar_document(estimate, settings["front_lidar"])
    write_json(front_lidar, document, "front_lidar_calibration")
    quality = document["quality"]
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs={"boards": boards, "cameras": cameras, "board": board, "drawing": drawing},
        counts={
            name: quality[name]
            for name in ("views", "views_refused", "returns", "inliers", "starts", "starts_agreed")
        },
        figures=figures_of(document),
        gates=gates,
        notes=[
            f"view {name}: {reason}"
            for name, reason in zip(views.names, estimate.reasons, strict=True)
            if reason
        ]
        + document["verdict"]["reasons"],
    )
