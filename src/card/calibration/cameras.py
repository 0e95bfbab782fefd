"""Intrinsics of both cameras and their stereo pose from the board views of a session."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import write_json, write_report
from card.calibration.board import Board
from card.calibration.board_views import read_board_views
from card.calibration.camera_document import camera_document, figures_of
from card.calibration.camera_estimate import estimate_cameras


def calibrate_cameras(
    *,
    boards: Path,
    board: Path,
    cameras: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Estimate both cameras and write them as document `camera_calibration`.

    Parameters
    ----------
    boards : table `board_detections` of a session.
    board : its board.yaml.

    Raises
    ------
    CardError
        For views that cannot make a calibration: too few, all frontal or central, pairs that do not belong
        together, left and right swapped. It names a view.
    """
    pattern = Board.read(board)
    found = estimate_cameras(read_board_views(boards, pattern), pattern, settings["cameras"], boards)
    document = camera_document(found, pattern, settings["cameras"])
    write_json(cameras, document, "camera_calibration")
    quality = document["quality"]
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs={"boards": boards, "board": board},
        counts={name: quality[name] for name in ("views", "views_refused", "corners", "inliers")},
        figures=figures_of(document),
        gates=gates,
        notes=[
            f"view {name}: {reason}"
            for name, reason in zip(found.views.names, found.reasons, strict=True)
            if reason
        ]
        + document["verdict"]["reasons"],
    )
