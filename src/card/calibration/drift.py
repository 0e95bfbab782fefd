"""How far the sessions of a drive day are apart: what heat and rough roads did to the rig."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure, read_json, write_json, write_report
from card.calibration.state import step_between
from card.errors import CardError
from card.geometry import from_json, inverse

#: Figure prefix: the frame and the sensor whose pose in it is compared; without a sensor, the IMU's rig.
PAIRS = {
    "stereo": ("rig_from_camera_left", "rig_from_camera_right"),
    "camera_lidar": ("rig_from_lidar_front", "rig_from_camera_left"),
    "rear": ("rig_from_lidar_front", "rig_from_lidar_rear"),
    "imu": (None, "rig_from_lidar_front"),
}
_WHAT = {
    "stereo": "the right camera in the left one",
    "camera_lidar": "the left camera in the front LiDAR",
    "rear": "the rear LiDAR in the front one",
    "imu": "the front LiDAR in the rig",
}
_FIGURES = {
    **{f"{name}_deg": f"the angle of {text}" for name, text in _WHAT.items()},
    **{f"{name}_mm": f"the position of {text}" for name, text in _WHAT.items()},
    "focal_pct": "a focal length",
}
_UNITS = {"deg": "deg", "mm": "mm", "pct": "%"}


def measure_drift(
    *,
    bundles: Sequence[Path],
    drift: Path,
    report: Path,
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Compare the bundles of a day, each with each, and write the differences (schema ``calibration_drift``).

    Parameters
    ----------
    bundles : two or more, delivered or estimated (schema ``calibration``).
    drift, report : the files to write; a figure of the report is the largest difference of any two sessions.

    Raises
    ------
    CardError
        If the bundles are not of one day.
    """
    found = [read_json(path, "calibration") for path in bundles]
    sessions = [bundle["session"] for bundle in found]
    days = sorted({session["day"] for session in sessions})
    if len(days) > 1:
        raise CardError("bundles of several days", where=drift, found=", ".join(days))
    pairs = [differences(one, other) for one, other in combinations(found, 2)]
    names = [[one["id"], other["id"]] for one, other in combinations(sessions, 2)]
    rows = [{"sessions": of, **pair} for of, pair in zip(names, pairs, strict=True)]
    document = {"schema": "calibration_drift", "day": days[0], "pairs": rows}
    write_json(drift, document, "calibration_drift")
    write_report(
        report,
        stage="calibration_drift",
        settings={},
        inputs={bundle["session"]["id"]: path for bundle, path in zip(found, bundles, strict=True)},
        counts={"sessions": len(found)},
        figures=[
            Figure(
                f"drift_{name}",
                max(pair[name] for pair in pairs),
                _UNITS[name.rsplit("_", 1)[1]],
                f"largest difference of {text} between two sessions of the day",
            )
            for name, text in _FIGURES.items()
        ],
        gates=gates,
    )


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, float]:
    """Differences of two bundles by name: angles in deg, distances in mm, focal lengths in %."""
    result = {}
    for name, (base, sensor) in PAIRS.items():
        poses = [_pose(bundle, base, sensor) for bundle in (one, other)]
        step = step_between(*poses)
        result[f"{name}_deg"] = float(np.degrees(np.linalg.norm(step[3:])))
        result[f"{name}_mm"] = 1e3 * float(np.linalg.norm(step[:3]))
    ratios = [
        other["cameras"][camera][axis] / one["cameras"][camera][axis]
        for camera in ("camera_left", "camera_right")
        for axis in ("fx", "fy")
    ]
    result["focal_pct"] = 100 * float(np.abs(np.log(ratios)).max())
    return result


def _pose(bundle: Mapping[str, Any], base: str | None, sensor: str) -> NDArray[np.float64]:
    rig_from_sensor = from_json(bundle["extrinsics"][sensor])
    return (
        rig_from_sensor if base is None else inverse(from_json(bundle["extrinsics"][base])) @ rig_from_sensor
    )
