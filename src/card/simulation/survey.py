"""The survey of a day: a total station measures board and wheels while the cameras see the board."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_folder, check, write_json
from card.geometry import apply, inverse, quaternion_from_matrix, to_json, transform
from card.simulation import board
from card.simulation.board_images import BoardCameras, write_board_yaml
from card.simulation.board_scene import board_quads, place_board, surroundings
from card.simulation.calibrations import session_rig, session_start_ns, true_calibration
from card.simulation.rig import RIG_HEIGHT_M, WHEELS, Rig

Array = NDArray[np.float64]

SURVEYS, POSES = 3, 3
NOISE_M = 1e-3
"""One sigma of a measured coordinate."""

_TILT_DEG = 6.0
_SURVEY_NS, _POSE_NS = 900_000_000_000, 180_000_000_000


def simulate_survey(day: str, *, folder: Path, truth: Path, scale: str, seed: int) -> None:
    """Write the survey of a day: three times three board poses, eight points each, and the wheels.

    day : ISO date; the survey follows the day's first session and shares its calibration.
    folder : gets board.yaml, survey-<n>/points.csv (schema ``survey_point``) and
        survey-<n>/pose-<m>/camera_left|camera_right/<t_ns>.jpg.
    truth : gets calibration.json and board_poses.json.
    """
    session = f"{day}-start"
    rig = session_rig(session, seed, scale)
    rng = np.random.default_rng([seed, *f"{day}-leica".encode()])
    cameras = BoardCameras(rig, surroundings(rng))
    views: list[dict[str, Any]] = []
    stations: list[dict[str, Any]] = []
    with atomic_folder(folder) as partial:
        write_board_yaml(partial)
        for survey in range(1, SURVEYS + 1):
            station = _station(rng)
            stations.append(to_json(station))
            points = [_measured(inverse(station), xyz, *name, rng) for name, xyz in _wheel_points(rig)]
            for pose in range(1, POSES + 1):
                rig_from_board = place_board(rig, cameras.ego, rng, tilt_deg=_TILT_DEG)
                marks = apply(rig_from_board, board.marked_points_m())
                for number, xyz in enumerate(marks, 1):
                    points.append(_measured(inverse(station), xyz, f"pose-{pose}", f"p{number}", rng))
                view = f"survey-{survey}/pose-{pose}"
                t_ns = session_start_ns(session) + survey * _SURVEY_NS + pose * _POSE_NS
                cameras.photograph(partial / view, board_quads(rig_from_board), t_ns, rng)
                views.append({"folder": view, "t_ns": t_ns, "rig_from_board": to_json(rig_from_board)})
            _write_points(partial / f"survey-{survey}" / "points.csv", points)
    with atomic_folder(truth) as partial:
        write_json(partial / "calibration.json", true_calibration(session, seed, scale), "calibration")
        poses = {"schema": "board_poses", "views": views, "stations": stations}
        write_json(partial / "board_poses.json", poses, "board_poses")


def _station(rng: np.random.Generator) -> Array:
    """``rig_from_station``: on its tripod, level, some metres to the side, turned anyhow."""
    heading = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(heading), np.sin(heading)
    side = rng.choice([-1.0, 1.0])
    place = [side * rng.uniform(3.0, 6.0), rng.uniform(0.0, 5.0), 1.5 - RIG_HEIGHT_M]
    return transform(place, quaternion_from_matrix(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])))


def _wheel_points(rig: Rig) -> list[tuple[tuple[str, str], Array]]:
    return [
        ((f"wheel_{wheel}", name), points[wheel])
        for wheel in WHEELS
        for name, points in (("center", rig.wheel_center_m), ("contact", rig.wheel_contact_m))
    ]


def _measured(
    station_from_rig: Array, xyz: Array, target: str, point: str, rng: np.random.Generator
) -> dict[str, Any]:
    x, y, z = (apply(station_from_rig, xyz) + rng.normal(0, NOISE_M, 3)).round(4).tolist()
    return {"target": target, "point": point, "x_m": x, "y_m": y, "z_m": z}


def _write_points(path: Path, points: list[dict[str, Any]]) -> None:
    for number, row in enumerate(points, 2):
        check(row, "survey_point", f"{path}:{number}")
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(points[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(points)
