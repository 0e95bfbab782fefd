"""Errors of the calibration bundles against the simulated cars they describe."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json
from card.geometry import apply, from_json, inverse

WHEELS = ("fl", "fr", "rl", "rr")
#: Figure prefix: the two frames whose relative pose is judged, and the aims in deg and mm.
PAIRS = {
    "stereo": ("rig_from_camera_left", "rig_from_camera_right", 0.005, 0.5),
    "camera_lidar": ("rig_from_camera_left", "rig_from_lidar_front", 0.03, 3.0),
    "rear": ("rig_from_lidar_front", "rig_from_lidar_rear", 0.005, 1.0),
}
#: Of the front LiDAR in the rig, whose origin is the IMU: deg and mm.
IMU_AIMS = 0.02, 6.0
WHEEL_CONTACT_AIM_MM = 2.0


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Medians over sessions, those estimated and those the sequences take: relative poses, wheel contacts.

    Contacts are those of the surveys, where there are any: a bundle's come to it by way of the front LiDAR.

    work : folder with ``results/<id>/`` and ``results/sessions/``; truth : with
    ``sessions/<session>/calibration.json``.
    """
    files = sorted((work / "results" / "sessions").glob("*/calibration.json"))
    files += [work / "results" / sequence / "calibration.json" for sequence in sequences]
    errors: dict[str, list[float]] = defaultdict(list)
    sessions: set[str] = set()
    for file in files:
        found = read_json(file, "calibration") if file.is_file() else None
        if found is None or found["session"]["id"] in sessions:
            continue
        true = truth / "sessions" / found["session"]["id"] / "calibration.json"
        if not true.is_file():
            continue
        sessions.add(found["session"]["id"])
        for figure, value in bundle_errors(found, read_json(true, "calibration")).items():
            errors[figure].append(value)
    surveyed = _survey_errors(work, truth)
    errors["wheel_contact_mm"] = surveyed or errors["wheel_contact_mm"]
    aims = {f"{name}_deg": deg for name, (_, _, deg, _) in PAIRS.items()}
    aims |= {f"{name}_mm": mm for name, (_, _, _, mm) in PAIRS.items()}
    aims["imu_deg"], aims["imu_mm"] = IMU_AIMS
    aims["wheel_contact_mm"] = WHEEL_CONTACT_AIM_MM
    return [
        {
            "stage": "calibration",
            "figure": figure,
            "value": float(np.median(errors[figure])) if errors[figure] else None,
            "unit": figure.rsplit("_", 1)[1],
            "aim": aim,
            "better": "lower",
        }
        for figure, aim in sorted(aims.items())
    ]


def bundle_errors(found: Mapping[str, Any], true: Mapping[str, Any]) -> dict[str, float]:
    """Errors of one bundle by figure: angles in deg, distances in mm.

    Contacts are compared in the left camera, as the worst wheel's: where the IMU is, is a figure of its own.
    """
    errors = {}
    for name, (one, other, _, _) in PAIRS.items():
        error = inverse(_between(true, one, other)) @ _between(found, one, other)
        errors[f"{name}_deg"] = angle_deg(error[:3, :3])
        errors[f"{name}_mm"] = 1e3 * float(np.linalg.norm(error[:3, 3]))
    errors |= imu_errors(found, true)
    errors["wheel_contact_mm"] = _worst_mm(_contacts(found), _contacts(true))
    return errors


def imu_errors(found: Mapping[str, Any], true: Mapping[str, Any]) -> dict[str, float]:
    """Errors of where the IMU is in the front LiDAR: imu_deg and imu_mm."""
    ours, theirs = (from_json(bundle["extrinsics"]["rig_from_lidar_front"]) for bundle in (found, true))
    distance = float(np.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
    return {"imu_deg": angle_deg(ours[:3, :3] @ theirs[:3, :3].T), "imu_mm": 1e3 * distance}


def _survey_errors(work: Path, truth: Path) -> list[float]:
    """Worst contact of each survey, mm."""
    errors = []
    for file in sorted((work / "results" / "sessions").glob("*-leica/rig_wheels.json")):
        true = truth / "sessions" / file.parent.name / "calibration.json"
        if true.is_file():
            wheels = read_json(file, "rig_wheels_calibration")["camera_left"]["wheels"]
            found = np.array([wheels[wheel]["contact_m"] for wheel in WHEELS])
            errors.append(_worst_mm(found, _contacts(read_json(true, "calibration"))))
    return errors


def _worst_mm(found: NDArray[np.float64], true: NDArray[np.float64]) -> float:
    return 1e3 * float(np.linalg.norm(found - true, axis=1).max())


def _contacts(bundle: Mapping[str, Any]) -> NDArray[np.float64]:
    """Wheel contacts (4, 3) in the left camera, metres."""
    contacts = np.array([bundle["wheels"][wheel]["contact_m"] for wheel in WHEELS])
    return apply(inverse(from_json(bundle["extrinsics"]["rig_from_camera_left"])), contacts)


def angle_deg(rotation: NDArray[np.float64]) -> float:
    """Angle of a rotation (3, 3), from its skew part: exact for small angles, where the trace is not."""
    skew = rotation - rotation.T
    sine = 0.5 * float(np.linalg.norm([skew[2, 1], skew[0, 2], skew[1, 0]]))
    return float(np.degrees(np.arctan2(sine, (np.trace(rotation) - 1) / 2)))


def _between(bundle: Mapping[str, Any], one: str, other: str) -> NDArray[np.float64]:
    extrinsics = bundle["extrinsics"]
    pose: NDArray[np.float64] = inverse(from_json(extrinsics[one])) @ from_json(extrinsics[other])
    return pose
