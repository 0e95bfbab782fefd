"""Rig-wheel calibration of a drive day: wheel centers and contacts in the left camera, from Leica surveys."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure, read_json, read_yaml, write_json, write_report
from card.calibration.board import Board
from card.calibration.board_views import read_board_views
from card.calibration.front_sensors import FrontSensors
from card.calibration.rig_wheels_document import rig_wheels_document
from card.calibration.survey_alignment import Alignment, Observed, align_station
from card.calibration.survey_boards import check_still, observed_boards
from card.calibration.survey_checks import with_agreeing_wheels, with_sound_marks
from card.calibration.survey_points import POINTS, read_surveys
from card.calibration.wheel_mean import mean_wheels

Array = NDArray[np.float64]

#: Rounds in which the surveys' own scatter replaces the sigmas that the settings begin with.
_SIGMA_ROUNDS = 3


def calibrate_rig_wheels(
    *,
    survey: Path,
    boards: Path,
    front_lidar: Path,
    board: Path,
    rig_wheels: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write where the wheels are in the left camera (schema ``rig_wheels_calibration``).

    Paper, supplement 'Rig-Wheel calibration with Leica': each survey is aligned rigidly to the board as the
    cameras see it and refined on reprojection and surveyed points together, with the cameras fixed; the
    surveys are averaged on SE(3).

    Parameters
    ----------
    survey : folder with survey-<n>/points.csv.
    boards : the board in the survey's images (schema ``board_detections``), views named survey-<n>/pose-<m>.
    front_lidar : cameras and front LiDAR of a session of that day (schema ``front_lidar_calibration``).
    board : board.yaml of the survey.

    Raises
    ------
    CardError
        Naming survey, pose and point, if a survey is incomplete, in another unit, or does not fit together.
    """
    chosen = settings["rig_wheels"]
    target, document = Board.read(board), read_json(front_lidar, "front_lidar_calibration")
    sensors = FrontSensors.from_json(document)
    flat = np.array(read_yaml(board, "board")["marked_points_m"], dtype=np.float64)
    marks = np.column_stack([flat, np.zeros(len(flat))])
    surveys, notes = read_surveys(survey, marks, chosen), []
    for number, found in enumerate(surveys):
        surveys[number], mended = with_sound_marks(found, marks, chosen)
        notes += mended
    surveys, mended = with_agreeing_wheels(surveys, chosen)
    notes += mended
    views = read_board_views(boards, target)
    observed, started = [], []
    for found in surveys:
        seen, poses, dropped = observed_boards(found, target.corners_m, marks, views, sensors, chosen)
        observed.append(seen)
        started.append(poses)
        notes += dropped
    sigmas = document["quality"]["corner_sigma_px"], chosen["survey_sigma_m"]
    for found, seen, poses in zip(surveys, observed, started, strict=True):
        check_still(found, seen, poses, sensors, sigmas, chosen)
    alignments, sigmas = align_surveys(sensors, observed, started, sigmas)
    wheels = mean_wheels(alignments, np.stack([found.wheels for found in surveys]), sigmas[1])
    result = rig_wheels_document(surveys, alignments, wheels, sensors, sigmas, chosen)
    write_json(rig_wheels, result, "rig_wheels_calibration")
    quality = result["quality"]
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs={
            "boards": boards,
            "front_lidar": front_lidar,
            "board": board,
            **{found.name: survey / found.name / POINTS for found in surveys},
        },
        counts={
            "surveys": len(surveys),
            "poses": sum(len(found.poses) for found in surveys),
            "points": quality["points"],
        },
        figures=[
            Figure("survey_sigma_mm", quality["survey_sigma_mm"], "mm", "scatter of a surveyed coordinate"),
            Figure(
                "survey_spread_mm",
                quality["spread_mm"],
                "mm",
                "largest distance of a wheel point of one survey to the mean",
            ),
            Figure(
                "wheel_contact_sigma_mm",
                quality["contact_sigma_mm"],
                "mm",
                "largest standard deviation of a contact along an axis",
            ),
            Figure(
                "survey_reprojection_px",
                quality["reprojection_rms_px"],
                "px",
                "rms reprojection error over both coordinates",
            ),
        ],
        gates=gates,
        notes=notes + result["verdict"]["reasons"],
    )


def align_surveys(
    sensors: FrontSensors,
    observed: Sequence[Observed],
    boards: Sequence[Array],
    sigmas: tuple[float, float],
) -> tuple[list[Alignment], tuple[float, float]]:
    """Fit all surveys; the scatter of corners (px) and surveyed points (m) is estimated from all of them."""
    alignments: list[Alignment] = []
    for _ in range(_SIGMA_ROUNDS):
        alignments = [
            align_station(sensors, seen, poses, *sigmas) for seen, poses in zip(observed, boards, strict=True)
        ]
        sigmas = (
            _pooled([a.corner_px for a in alignments], [a.corner_freedom for a in alignments]),
            _pooled([a.mark_m for a in alignments], [a.mark_freedom for a in alignments]),
        )
    return alignments, sigmas


def _pooled(residuals: Sequence[Array], freedom: Sequence[float]) -> float:
    return float(np.sqrt(sum(float(np.sum(np.square(values))) for values in residuals) / sum(freedom)))
