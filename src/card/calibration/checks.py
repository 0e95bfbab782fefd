"""Whether a calibration bundle can be true of a car: each check names the entry that fails."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import from_json, inverse

Document = Mapping[str, Any]
WHEELS = ("fl", "fr", "rl", "rr")
LIDARS = ("lidar_front", "lidar_rear")
#: Eigenvalues below minus this share of the largest are more than rounding.
COVARIANCE_ROUNDING = 1e-9


def check_bundle(bundle: Document, settings: Mapping[str, Any], where: object) -> None:
    """Check the geometry of a bundle that fits schema ``calibration``.

    Raises
    ------
    CardError
        Naming the entry, what was found and what is wanted.
    """
    check_rotations(bundle["extrinsics"], settings, where)
    check_cameras(bundle, settings, where)
    check_wheels(bundle["wheels"], settings, where)
    check_corrections(bundle["lidar_corrections"], settings, where)
    if "imu_corrections" in bundle:
        check_imu_corrections(bundle["imu_corrections"], settings["max_imu_correction"], where)
    check_covariances(bundle["covariances"], where)


def baseline(extrinsics: Document) -> NDArray[np.float64]:
    """Position (3,) of the right camera in the left one, metres."""
    left_from_rig = inverse(from_json(extrinsics["rig_from_camera_left"]))
    position: NDArray[np.float64] = (left_from_rig @ from_json(extrinsics["rig_from_camera_right"]))[:3, 3]
    return position


def check_rotations(extrinsics: Document, settings: Mapping[str, Any], where: object) -> None:
    """Every rotation is a unit quaternion."""
    for name, entry in extrinsics.items():
        norm = float(np.linalg.norm(entry["rotation_wxyz"]))
        if abs(norm - 1) > settings["max_quaternion_error"]:
            raise CardError(
                f"{name} has no unit quaternion",
                where=where,
                found=f"norm {norm:.6f}",
                wanted=f"1 within {settings['max_quaternion_error']:g}",
            )


def check_cameras(bundle: Document, settings: Mapping[str, Any], where: object) -> None:
    """Cameras of one size with the principal point inside look forward; the right one is at the right."""
    cameras = {**bundle["cameras"], "camera_left_undistorted": bundle["camera_left_undistorted"]}
    for name, camera in cameras.items():
        if not (0 <= camera["cx"] < camera["width"] and 0 <= camera["cy"] < camera["height"]):
            raise CardError(
                f"{name} has its principal point outside the image",
                where=where,
                found=f"{camera['cx']:.1f}, {camera['cy']:.1f}",
                wanted=f"inside {camera['width']} x {camera['height']}",
            )
    left, right = (bundle["cameras"][name] for name in ("camera_left", "camera_right"))
    sizes = [f"{camera['width']} x {camera['height']}" for camera in (left, right)]
    if sizes[0] != sizes[1]:
        raise CardError("cameras differ in size", where=where, found=sizes[1], wanted=sizes[0])
    for name in ("camera_left", "camera_right"):
        rig_from_camera = from_json(bundle["extrinsics"][f"rig_from_{name}"])
        down, ahead = rig_from_camera[:3, 1], rig_from_camera[:3, 2]
        if ahead[1] <= 0 or down[2] >= 0:
            raise CardError(
                f"rig_from_{name} does not look forward and upright",
                where=where,
                found=f"optical axis {_round(ahead)}, image down {_round(down)}",
                wanted="forward +y, down -z in rig; inverted transform?",
            )
    offset = baseline(bundle["extrinsics"])
    low, high = settings["min_baseline_m"], settings["max_baseline_m"]
    if not low <= offset[0] <= high:
        raise CardError(
            "right camera is not at the right of the left one" if offset[0] < low else "baseline too long",
            where=where,
            found=f"x {offset[0]:.3f} m in camera_left",
            wanted=f"{low:g} to {high:g} m; cameras swapped?",
        )


def check_wheels(wheels: Document, settings: Mapping[str, Any], where: object) -> None:
    """Wheels stand where their names say, each contact a wheel radius below its center."""
    center = {name: np.asarray(wheels[name]["center_m"], dtype=np.float64) for name in WHEELS}
    contact = {name: np.asarray(wheels[name]["contact_m"], dtype=np.float64) for name in WHEELS}
    spans = [
        (f"{right} is not right of {left}", (right, left), 0, "track")
        for left, right in (("fl", "fr"), ("rl", "rr"))
    ] + [
        (f"{front} is not ahead of {rear}", (front, rear), 1, "wheelbase")
        for front, rear in (("fl", "rl"), ("fr", "rr"))
    ]
    for what, (far, near), axis, span in spans:
        low, high = settings[f"min_{span}_m"], settings[f"max_{span}_m"]
        for points in (center, contact):
            length = float(points[far][axis] - points[near][axis])
            if not low <= length <= high:
                raise CardError(
                    f"wheel {what}" if length <= 0 else f"implausible {span} between wheels {near} and {far}",
                    where=where,
                    found=f"{length:.3f} m",
                    wanted=f"{low:g} to {high:g} m",
                )
    for name in WHEELS:
        radius = float(center[name][2] - contact[name][2])
        low, high = settings["min_wheel_radius_m"], settings["max_wheel_radius_m"]
        if not low <= radius <= high:
            raise CardError(
                f"contact of wheel {name} is not a radius below its center",
                where=where,
                found=f"{radius:.3f} m",
                wanted=f"{low:g} to {high:g} m",
            )


def check_corrections(corrections: Document, settings: Mapping[str, Any], where: object) -> None:
    """LiDAR corrections stay in the range a sensor of its kind can need."""
    limits = {
        "range_offset_m": settings["max_range_offset_m"],
        "channel_range_offset_m": settings["max_range_offset_m"],
        "channel_elevation_offset_rad": settings["max_angle_offset_rad"],
        "channel_azimuth_offset_rad": settings["max_angle_offset_rad"],
    }
    for lidar in LIDARS:
        for name, limit in limits.items():
            values = np.atleast_1d(np.asarray(corrections[lidar][name], dtype=np.float64))
            worst = int(np.argmax(np.abs(values)))
            if abs(values[worst]) > limit:
                channel = f" of channel {worst}" if values.size > 1 else ""
                raise CardError(
                    f"{name}{channel} of {lidar} out of range",
                    where=where,
                    found=f"{values[worst]:g}",
                    wanted=f"at most {limit:g} either way; degrees or millimetres?",
                )


def check_imu_corrections(corrections: Document, limit: float, where: object) -> None:
    """What is wrong with the IMU's axes is small, and not a rotation, which is in the extrinsics."""
    for name, rows in corrections.items():
        matrix = np.asarray(rows, dtype=np.float64)
        if np.any(np.tril(matrix, -1)):
            raise CardError(f"imu_corrections of {name} are not upper triangular", where=where)
        off = matrix - np.eye(3)
        i, j = np.unravel_index(int(np.argmax(np.abs(off))), off.shape)
        if abs(off[i, j]) > limit:
            raise CardError(
                f"imu_corrections of {name} out of range in row {i}, column {j}",
                where=where,
                found=f"{matrix[i, j]:g}",
                wanted=f"{'1' if i == j else '0'} within {limit:g}",
            )


def check_covariances(covariances: Document, where: object) -> None:
    """Covariances are symmetric and have no negative variance in any direction."""
    for name, rows in covariances.items():
        matrix = np.asarray(rows, dtype=np.float64)
        scale = float(np.abs(matrix).max())
        if np.abs(matrix - matrix.T).max() > COVARIANCE_ROUNDING * scale:
            raise CardError(f"covariance of {name} is not symmetric", where=where)
        smallest = float(np.linalg.eigvalsh(matrix)[0])
        if smallest < -COVARIANCE_ROUNDING * scale:
            raise CardError(
                f"covariance of {name} is not positive semidefinite",
                where=where,
                found=f"eigenvalue {smallest:.3g}",
                wanted=">= 0",
            )


def _round(values: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in values) + ")"
