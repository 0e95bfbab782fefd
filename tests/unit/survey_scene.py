"""A surveyed drive day at detection level: what cameras and total station measure, without images."""

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import default_settings, load_schema, write_json, write_table
from card.calibration.board import Board
from card.calibration.board_views import BoardViews
from card.calibration.camera_estimate import estimate_cameras
from card.calibration.front_sensors import FrontSensors
from card.calibration.state import (
    INTRINSICS,
    LIDAR,
    SHARED,
    STEREO,
    State,
    camera_model,
    corrections_document,
    intrinsics_of,
)
from card.calibration.survey_alignment import Observed
from card.calibration.survey_points import WHEEL_POINTS, WHEELS
from card.geometry import apply, inverse, quaternion_from_matrix, to_json, transform
from card.simulation import board
from card.simulation.board_images import write_board_yaml
from card.simulation.board_observations import board_places
from card.simulation.rig import CAMERAS, Rig, built_rig

Array = NDArray[np.float64]

SURVEYS, POSES, NOISE_M, NOISE_PX = 3, 3, 1e-3, 0.1


@dataclass
class Scene:
    """One day.

    wheels : (8, 3) true, in the true left camera; in_lidar : in the true front LiDAR.
    sensors : as calibrated, with their covariance.
    pixels : (K, P, 2, 40, 2).  marks : (K, P, 8, 3) and surveyed_wheels : (K, 8, 3) as measured.
    """

    wheels: Array
    in_lidar: Array
    sensors: FrontSensors
    pixels: Array
    marks: Array
    surveyed_wheels: Array

    def observed(self) -> list[Observed]:
        return [
            Observed(board.corners_m(), board.marked_points_m(), pixels, marks)
            for pixels, marks in zip(self.pixels, self.marks, strict=True)
        ]

    def write(self, folder: Path) -> dict[str, Path]:
        """Write all that `calibrate_rig_wheels` reads; its arguments by name."""
        survey = folder / "survey"
        survey.mkdir(parents=True)
        write_board_yaml(survey)
        for number, (marks, wheels) in enumerate(zip(self.marks, self.surveyed_wheels, strict=True), 1):
            rows = [(*name, *xyz) for name, xyz in zip(WHEEL_POINTS, wheels, strict=True)]
            rows += [
                (f"pose-{p}", f"p{m}", *xyz)
                for p, pose in enumerate(marks, 1)
                for m, xyz in enumerate(pose, 1)
            ]
            path = survey / f"survey-{number}" / "points.csv"
            path.parent.mkdir()
            with path.open("w", newline="") as file:
                csv.writer(file).writerows([("target", "point", "x_m", "y_m", "z_m"), *rows])
        write_table(folder / "boards.parquet", self._detections(), "board_detections")
        write_json(folder / "front_lidar.json", self._front_lidar(), "front_lidar_calibration")
        return {
            "survey": survey,
            "boards": folder / "boards.parquet",
            "front_lidar": folder / "front_lidar.json",
            "board": survey / "board.yaml",
            "rig_wheels": folder / "rig_wheels.json",
            "report": folder / "rig_wheels.report.json",
        }

    def _detections(self) -> dict[str, Any]:
        shape = self.pixels.shape[:4]
        survey, pose, side, corner = (index.ravel() for index in np.indices(shape))
        return {
            "camera": np.array(CAMERAS)[side].tolist(),
            "view": [f"survey-{k + 1}/pose-{p + 1}" for k, p in zip(survey, pose, strict=True)],
            "t_ns": survey * 1000 + pose,
            "corner": corner.astype(np.int32),
            "x_px": self.pixels[..., 0].ravel(),
            "y_px": self.pixels[..., 1].ravel(),
            "width_px": np.full(corner.size, 2248, np.int32),
            "height_px": np.full(corner.size, 2252, np.int32),
        }

    def _front_lidar(self) -> dict[str, Any]:
        sensors, covariance = self.sensors, self.sensors.covariance
        parts = {"camera_left": INTRINSICS[0], "camera_right": INTRINSICS[1], "left_from_right": STEREO}
        parts |= dict.fromkeys(("lidar_front_from_camera_left", "lidar_front_from_camera_right"), LIDAR)
        figures = load_schema("front_lidar_calibration")["properties"]["quality"]["required"]
        return {
            "schema": "front_lidar_calibration",
            "cameras": {
                name: camera_model(row, 2248, 2252).to_json()
                for name, row in zip(CAMERAS, sensors.intrinsics, strict=True)
            },
            "left_from_right": to_json(sensors.left_from_right),
            "lidar_front_from_camera_left": to_json(sensors.lidar_from_left),
            "lidar_front_from_camera_right": to_json(sensors.lidar_from_left @ sensors.left_from_right),
            "corrections": corrections_document(np.zeros(97)),
            "sigmas": corrections_document(np.zeros(97)),
            "covariances": {
                **{name: covariance[part, part].tolist() for name, part in parts.items()},
                "together": covariance.tolist(),
            },
            "views": [],
            "quality": {**dict.fromkeys(figures, 0), "corner_sigma_px": NOISE_PX},
            "verdict": {"passed": True, "reasons": []},
        }


def surveyed_day(seed: int) -> Scene:
    """A day of the simulated car with full-size images, surveyed three times."""
    rng = np.random.default_rng([seed, 77])
    rig = built_rig("2026-04-14", seed, 2248, 2252)
    left_from_rig = inverse(rig.rig_from["camera_left"])
    wheels = apply(left_from_rig, _wheels(rig))
    places = board_places(rig, SURVEYS * POSES, rng).reshape(SURVEYS, POSES, 4, 4)
    pixels = np.array([[[_seen(rig, camera, p) for camera in CAMERAS] for p in poses] for poses in places])
    pixels += rng.normal(0, NOISE_PX, pixels.shape)
    marks, surveyed = [], []
    for of_survey in places:
        station_from_left = inverse(_station(rng))
        seen = [apply(left_from_rig @ place, board.marked_points_m()) for place in of_survey]
        marks.append([apply(station_from_left, xyz) + rng.normal(0, NOISE_M, xyz.shape) for xyz in seen])
        surveyed.append(apply(station_from_left, wheels) + rng.normal(0, NOISE_M, wheels.shape))
    in_lidar = apply(inverse(rig.rig_from["lidar_front"]), _wheels(rig))
    return Scene(wheels, in_lidar, _calibrated(rig, rng), pixels, np.array(marks), np.array(surveyed))


def _wheels(rig: Rig) -> Array:
    return np.array([points[w] for w in WHEELS for points in (rig.wheel_center_m, rig.wheel_contact_m)])


def _seen(rig: Rig, camera: str, place: Array) -> Array:
    return rig.cameras[camera].project(apply(inverse(rig.rig_from[camera]) @ place, board.corners_m()))


def _station(rng: np.random.Generator) -> Array:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    return transform(rng.uniform((-4, -4, -1), (4, 4, 7)), quaternion_from_matrix(turn))


def _calibrated(rig: Rig, rng: np.random.Generator) -> FrontSensors:
    covariance = sensors_covariance()
    error = np.concatenate([rng.multivariate_normal(np.zeros(30), covariance), np.zeros(SHARED - 30)])
    true = State(
        np.stack([intrinsics_of(rig.cameras[name]) for name in CAMERAS]),
        inverse(rig.rig_from["camera_left"]) @ rig.rig_from["camera_right"],
        inverse(rig.rig_from["lidar_front"]) @ rig.rig_from["camera_left"],
        np.zeros(97),
        np.eye(4)[None],
    )
    found = true.moved(error, np.zeros((1, 6)))
    return FrontSensors(found.intrinsics, found.left_from_right, found.lidar_from_left, covariance)


@cache
def sensors_covariance() -> Array:
    """Covariance (30, 30) of cameras and front LiDAR after a session of 500 views.

    150 views stand for them, with more than three times their variance.
    The LiDAR was placed by what the cameras said of the boards: it takes over a part of their error that
    undoes another one, and has an error of its own.
    """
    rig, rng = built_rig("2026-04-14", 1, 2248, 2252), np.random.default_rng(5)
    places = board_places(rig, 150, rng)
    seen = np.array([[_seen(rig, camera, place) for place in places] for camera in CAMERAS])
    seen += rng.normal(0, NOISE_PX, seen.shape)
    names = tuple(str(number) for number in range(len(places)))
    views = BoardViews(names, np.arange(len(places)), seen, (2248, 2252))
    settings = default_settings("calibration")["cameras"]
    cameras = estimate_cameras(views, description_board(), settings, "views").solution.covariance[
        :24, :24
    ] * (150 / 500)
    taken_over = np.zeros((6, 24))
    taken_over[3, 3] = taken_over[4, 2] = 1 / 1600.0  # a principal point that is off turns the camera
    cross = taken_over @ cameras
    own = np.diag([1e-3] * 3 + [1e-4] * 3) ** 2
    return np.block([[cameras, cross.T], [cross, cross @ taken_over.T + own]])


def description_board() -> Board:
    """The simulated board as calibration knows it."""
    return Board(*board.INNER_CORNERS, board.SQUARE_M, np.array(board.SIZE_M), np.array(board.PLATE_CORNER_M))
