"""Transforms are rotations and translations, cameras are on their sides, times run forward."""

import math
from collections.abc import Iterator
from typing import Any

from card.packaging.checks.contents import Contents

TOLERANCE = 1e-6
MADE = {"calibration": "calibration.json", "poses": "poses.json", "wheels": "wheel_excitation.json"}


def check_geometry(contents: Contents) -> Iterator[str]:
    """Calibration, poses and road planes of every sequence."""
    numbers: dict[str, dict[int, int]] = {}
    for row in contents.all_frames():
        numbers.setdefault(row["sequence"], {})[row["frame"]] = row["t_ns"]
    gone: dict[str, set[int]] = {}
    for row in contents.retractions:
        if row["modality"] == "camera_left" and not row["region"]:
            gone.setdefault(row["sequence"], set()).add(row["frame"])
    for sequence, sidecars in sorted(contents.sidecars.items()):
        where = f"sequences/{sequence}"
        if calibration := sidecars.get("calibration.json"):
            for problem in _calibration(calibration):
                yield f"{where}/calibration.json: {problem}"
        if poses := sidecars.get("poses.json"):
            for problem in _poses(poses["poses"], numbers.get(sequence, {}), gone.get(sequence, set())):
                yield f"{where}/poses.json: {problem}"
        reported = sidecars.get("quality.json", {"stages": {}})["stages"]
        for stage, name in MADE.items():
            if stage in reported and not (contents.tree / where / name).exists():
                yield f"{where}/{name}: missing, though quality.json reports on {stage}"


def _calibration(calibration: Any) -> Iterator[str]:
    extrinsics = calibration["extrinsics"]
    for name, found in sorted(extrinsics.items()):
        if not _is_unit(found["rotation_wxyz"]):
            yield f"{name} is not a rotation: its quaternion has no unit length"
    left, right = (extrinsics[f"rig_from_camera_{side}"]["translation_m"][0] for side in ("left", "right"))
    if left >= right:
        yield f"camera_left is not left of camera_right (x {left:g} and {right:g} m in rig)"


def _poses(poses: Any, frames: dict[int, int], gone: set[int]) -> Iterator[str]:
    last: dict[str, int] = {}
    for row in poses:
        label = f"{row['sensor']} {row['index']}"
        if not _is_unit(row["rotation_wxyz"]):
            yield f"pose of {label} is not a rotation: its quaternion has no unit length"
        if row["t_ns"] <= last.get(row["sensor"], row["t_ns"] - 1):
            yield f"time of {label} does not increase"
        last[row["sensor"]] = row["t_ns"]
        if row["sensor"] != "camera_left" or row["index"] in gone:
            continue
        if frames.get(row["index"]) != row["t_ns"]:
            yield f"pose of {label} is not at the time of its frame"


def _is_unit(quaternion: list[float]) -> bool:
    return math.isclose(math.hypot(*quaternion), 1.0, abs_tol=TOLERANCE)
