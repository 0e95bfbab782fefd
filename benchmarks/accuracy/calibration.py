"""Errors of the calibration bundles against the simulated cars they describe."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json
from card.geometry import from_json, inverse

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
    """Medians over the sessions of the sequences: relative poses in deg and mm, wheel contacts in mm.

    work : folder with ``results/<id>/``; truth : folder with ``sessions/<session>/calibration.json``.
    """
    errors: dict[str, list[float]] = defaultdict(list)
    sessions: set[str] = set()
    for sequence in sequences:
        file = work / "results" / sequence / "calibration.json"
        found = read_json(file, "calibration") if file.is_file() else None
        if found is None or found["session"]["id"] in sessions:
            continue
        true = truth / "sessions" / found["session"]["id"] / "calibration.json"
        if not true.is_file():
            continue
        sessions.add(found["session"]["id"])
        for figure, value in bundle_errors(found, read_json(true, "calibration")).items():
            errors[figure].append(value)
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
    """Errors of one bundle by figure: angles in deg, distances in mm; contacts as the worst wheel's."""
    errors = {}
    for name, (one, other, _, _) in PAIRS.items():
        error = inverse(_between(true, one, other)) @ _between(found, one, other)
        errors[f"{name}_deg"] = angle_deg(error[:3, :3])
        errors[f"{name}_mm"] = 1e3 * float(np.linalg.norm(error[:3, 3]))
    errors |= imu_errors(found, true)
    contacts = [
        np.subtract(found["wheels"][wheel]["contact_m"], true["wheels"][wheel]["contact_m"])
        for wheel in WHEELS
    ]
    errors["wheel_contact_mm"] = 1e3 * float(np.linalg.norm(contacts, axis=1).max())
    return errors


def imu_errors(found: Mapping[str, Any], true: Mapping[str, Any]) -> dict[str, float]:
    """Errors of where the IMU is in the front LiDAR: imu_deg and imu_mm."""
    ours, theirs = (from_json(bundle["extrinsics"]["rig_from_lidar_front"]) for bundle in (found, true))
    distance = float(np.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
    return {"imu_deg": angle_deg(ours[:3, :3] @ theirs[:3, :3].T), "imu_mm": 1e3 * distance}


def angle_deg(rotation: NDArray[np.float64]) -> float:
    """Angle of a rotation (3, 3), from its skew part: exact for small angles, where the trace is not."""
    skew = rotation - rotation.T
    sine = 0.5 * float(np.linalg.norm([skew[2, 1], skew[0, 2], skew[1, 0]]))
    return float(np.degrees(np.arctan2(sine, (np.trace(rotation) - 1) / 2)))


def _between(bundle: Mapping[str, Any], one: str, other: str) -> NDArray[np.float64]:
    extrinsics = bundle["extrinsics"]
    pose: NDArray[np.float64] = inverse(from_json(extrinsics[one])) @ from_json(extrinsics[other])
    return pose
