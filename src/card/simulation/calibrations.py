"""The calibration that is true in a session, and the one that the team delivers for it."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import CameraModel, matrix_from_quaternion, to_json
from card.simulation.rig import (
    CAMERAS,
    CHANNELS,
    WHEELS,
    ImuUnit,
    LidarCorrections,
    Rig,
    built_rig,
    nominal_rig,
)
from card.simulation.scales import scale_named

Array = NDArray[np.float64]

SESSIONS = ("start", "mid", "end")
"""The sessions of a drive day, in order."""

# One sigma of what changes between the sessions of a day as the car warms up.
_DRIFT_ANGLE_RAD = np.radians(0.003)
_DRIFT_M = 1e-4
_DRIFT_FOCAL = 3e-5

# One sigma of a good estimate. Sensors are measured one against another, not each against the rig: which,
# against which (none: the rig), rad, m.
_CHAIN: tuple[tuple[str, str | None, float, float], ...] = (
    ("lidar_front", None, np.radians(0.01), 1e-3),
    ("camera_left", "lidar_front", np.radians(0.0075), 3e-4),
    ("lidar_rear", "lidar_front", np.radians(0.004), 1.5e-4),
    ("camera_right", "camera_left", np.radians(0.003), 3e-4),
)
_FOCAL = 5e-5
_CENTRE = 1e-4
_DISTORTION = (3e-4, 3e-4, 2e-5, 2e-5, 1e-4)
_WHEEL_M = 1.5e-3
_RANGE_M = 5e-4
_CHANNEL_RANGE_M, _CHANNEL_RAD = 1e-3, np.radians(0.005)
# A minute's drive turns a car about its z, and hardly tells more of the accelerometer than its maker.
_GYRO = 1e-4 * np.array([[2.0, 3.7, 1.0], [0.0, 4.9, 2.1], [0.0, 0.0, 0.6]])
_ACCEL = 1e-4 * np.array([[1.3, 2.8, 4.8], [0.0, 3.8, 4.9], [0.0, 0.0, 7.0]])


def day_of(session: str) -> tuple[str, str]:
    """Day (ISO date) and part of the day ("start", "mid", "end") of a session's name."""
    match = re.fullmatch(r"(\d{4}-\d{2}-\d{2})-(start|mid|end)", session)
    if not match:
        raise CardError("not a session", found=session, wanted="<day>-start, -mid or -end")
    return match[1], match[2]


def session_start_ns(session: str) -> int:
    """When a session begins: 8:00, 12:30 and 17:00 UTC, in ns since 1970."""
    day, part = day_of(session)
    hour = (8.0, 12.5, 17.0)[SESSIONS.index(part)]
    return int(np.datetime64(day, "ns").astype(np.int64)) + round(hour * 3600) * 1_000_000_000


def session_rig(session: str, seed: int, scale: str) -> Rig:
    """The car as it is in one session: the car of that day, moved a little by heat.

    Its wheels and LiDAR corrections are those of the day.
    """
    day, part = day_of(session)
    size = scale_named(scale)
    rig = built_rig(day, seed, size.width, size.height)
    rng = _rng(seed, session, 1)
    warmth = (0.0, 1.0, 0.6)[SESSIONS.index(part)]
    return replace(
        rig,
        cameras={
            name: _rescaled(rig.cameras[name], 1 + _DRIFT_FOCAL * warmth * rng.normal()) for name in CAMERAS
        },
        rig_from={
            name: _disturbed(pose, warmth * _DRIFT_ANGLE_RAD, warmth * _DRIFT_M, rng)
            for name, pose in rig.rig_from.items()
        },
    )


def true_calibration(session: str, seed: int, scale: str) -> dict[str, Any]:
    """The true calibration of a session, a document of schema ``calibration``.

    ``lidar_corrections`` are what has to be added to what a LiDAR measures, ``imu_corrections`` undo what
    the IMU makes of the truth.
    """
    rig = session_rig(session, seed, scale)
    quality = {"stereo_reprojection_px": 0.0, "board_plane_rms_m": 0.0, "views": 0}
    return _document(session, rig, {}, quality)


def delivered_calibration(session: str, seed: int, scale: str, views: int) -> dict[str, Any]:
    """What the team estimated in a session of so many views: the truth with the error of a good estimate.

    The front LiDAR errs against the rig by 0.01 degrees and 1 mm an axis, and all other sensors with it.
    Beyond that the left camera and the rear LiDAR err against it, and the right camera against the left, by
    what calibration reaches at full scale; the covariances say so. A LiDAR's channels are known to 1 mm and
    0.005 degrees, the IMU as well as a session's drive tells.
    """
    day, _ = day_of(session)
    rig = session_rig(session, seed, scale)
    rng = _rng(seed, session, 2)
    rig_from: dict[str, Array] = {}
    covariances: dict[str, Array] = {}
    for name, base, angle_rad, distance_m in _CHAIN:
        pose = rig.rig_from[name]
        covariance = np.diag([distance_m**2] * 3 + [angle_rad**2] * 3)
        if base is not None:
            # The base's rotation swings what is measured against it about the base's place.
            swing = np.eye(6)
            swing[:3, 3:] = -_cross(pose[:3, 3] - rig.rig_from[base][:3, 3])
            covariance += swing @ covariances[f"rig_from_{base}"] @ swing.T
            pose = rig_from[base] @ np.linalg.inv(rig.rig_from[base]) @ pose
        rig_from[name] = _disturbed(pose, angle_rad, distance_m, rng)
        covariances[f"rig_from_{name}"] = covariance
    wheel_rng = _rng(seed, day, 3)  # the wheels are surveyed once a day
    noisy = Rig(
        cameras={name: _estimated_camera(rig.cameras[name], rng) for name in CAMERAS},
        rig_from=rig_from,
        wheel_center_m={w: xyz + wheel_rng.normal(0, _WHEEL_M, 3) for w, xyz in rig.wheel_center_m.items()},
        wheel_contact_m={w: xyz + wheel_rng.normal(0, _WHEEL_M, 3) for w, xyz in rig.wheel_contact_m.items()},
        lidar_corrections={name: _estimated_lidar(c, wheel_rng) for name, c in rig.lidar_corrections.items()},
        imu=_estimated_imu(rig.imu, _rng(seed, session, 4)),
    )
    quality = {
        "stereo_reprojection_px": round(float(rng.uniform(0.15, 0.25)), 3),
        "board_plane_rms_m": round(float(rng.uniform(0.005, 0.007)), 4),
        "views": views,
    }
    return _document(session, noisy, {name: c.tolist() for name, c in covariances.items()}, quality)


def _document(session: str, rig: Rig, covariances: dict[str, Any], quality: dict[str, Any]) -> dict[str, Any]:
    # One pinhole for all days, that of the drawing: a mask drawn in it stays valid from session to session.
    left = rig.cameras["camera_left"]
    undistorted = nominal_rig(left.width, left.height).cameras["camera_left"].undistorted().to_json()
    return {
        "schema": "calibration",
        "session": {"id": session, "day": day_of(session)[0], "mode": "import"},
        "cameras": {name: camera.to_json() for name, camera in rig.cameras.items()},
        "camera_left_undistorted": {k: undistorted[k] for k in ("width", "height", "fx", "fy", "cx", "cy")},
        "extrinsics": {f"rig_from_{name}": to_json(pose) for name, pose in rig.rig_from.items()},
        "wheels": {
            w: {"center_m": rig.wheel_center_m[w].tolist(), "contact_m": rig.wheel_contact_m[w].tolist()}
            for w in WHEELS
        },
        "lidar_corrections": {name: _corrections(c) for name, c in rig.lidar_corrections.items()},
        "imu_corrections": {
            "gyro": np.triu(np.linalg.inv(rig.imu.gyro)).tolist(),
            "accel": np.triu(np.linalg.inv(rig.imu.accel)).tolist(),
        },
        "covariances": covariances,
        "quality": quality,
    }


def _corrections(corrections: LidarCorrections) -> dict[str, Any]:
    return {
        "range_offset_m": corrections.range_offset_m,
        "channel_range_offset_m": corrections.channel_range_offset_m.tolist(),
        "channel_elevation_offset_rad": corrections.channel_elevation_offset_rad.tolist(),
        "channel_azimuth_offset_rad": corrections.channel_azimuth_offset_rad.tolist(),
    }


def _disturbed(a_from_b: Array, angle_rad: float, distance_m: float, rng: np.random.Generator) -> Array:
    """A pose with its rotation and its translation each disturbed in frame a."""
    result = a_from_b.copy()
    half = 0.5 * rng.normal(0, angle_rad, 3)
    result[:3, :3] = matrix_from_quaternion(np.concatenate([[1.0], half])) @ a_from_b[:3, :3]
    result[:3, 3] += rng.normal(0, distance_m, 3)
    return result


def _rescaled(camera: CameraModel, zoom: float) -> CameraModel:
    return replace(camera, fx=camera.fx * zoom, fy=camera.fy * zoom)


def _estimated_camera(camera: CameraModel, rng: np.random.Generator) -> CameraModel:
    error = rng.normal(size=9)
    k1, k2, p1, p2, k3 = np.add(camera.distortion, error[4:] * _DISTORTION).tolist()
    return replace(
        camera,
        fx=camera.fx * (1 + _FOCAL * float(error[0])),
        fy=camera.fy * (1 + _FOCAL * float(error[1])),
        cx=camera.cx + _CENTRE * camera.width * float(error[2]),
        cy=camera.cy + _CENTRE * camera.width * float(error[3]),
        distortion=(k1, k2, p1, p2, k3),
    )


def _estimated_lidar(true: LidarCorrections, rng: np.random.Generator) -> LidarCorrections:
    return LidarCorrections(
        true.range_offset_m + float(rng.normal(0, _RANGE_M)),
        true.channel_range_offset_m + rng.normal(0, _CHANNEL_RANGE_M, CHANNELS),
        true.channel_elevation_offset_rad + rng.normal(0, _CHANNEL_RAD, CHANNELS),
        true.channel_azimuth_offset_rad + rng.normal(0, _CHANNEL_RAD, CHANNELS),
    )


def _estimated_imu(true: ImuUnit, rng: np.random.Generator) -> ImuUnit:
    return ImuUnit(true.gyro + _GYRO * rng.normal(size=(3, 3)), true.accel + _ACCEL * rng.normal(size=(3, 3)))


def _cross(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _rng(seed: int, name: str, purpose: int) -> np.random.Generator:
    return np.random.default_rng([seed, purpose, *name.encode()])
