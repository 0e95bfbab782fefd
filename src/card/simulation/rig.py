"""The simulated car: where its sensors and wheels are, as drawn and as really built."""

import datetime
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel, transform

Array = NDArray[np.float64]

CAMERAS = ("camera_left", "camera_right")
LIDARS = ("lidar_front", "lidar_rear")
WHEELS = ("fl", "fr", "rl", "rr")
CHANNELS = 32

#: Height of the rig's origin (IMU on the roof) over the contact points at rest.
RIG_HEIGHT_M = 1.70
WHEEL_RADIUS_M = 0.36
FRONT_AXLE_Y_M, REAR_AXLE_Y_M = 0.75, -2.14
HALF_TRACK_M = 0.84
STEREO_BASELINE_M = 0.60
#: The right camera's shutter follows the left one's.
STEREO_DELAY_NS = 200_000


@dataclass(frozen=True)
class LidarCorrections:
    """What has to be added to a LiDAR's measured values to have the true ones."""

    range_offset_m: float = 0.0
    channel_range_offset_m: Array = field(default_factory=lambda: np.zeros(CHANNELS))
    channel_elevation_offset_rad: Array = field(default_factory=lambda: np.zeros(CHANNELS))
    channel_azimuth_offset_rad: Array = field(default_factory=lambda: np.zeros(CHANNELS))


#: One sigma of what a car is built off its drawing by, each axis.
BUILT_RAD, BUILT_M = float(np.radians(0.2)), 0.003
#: One sigma of what a unit's channels are off by, and the most that its maker lets pass.
_CHANNEL_RAD, _CHANNEL_RAD_MOST = np.radians(0.03), np.radians(0.09)
_CHANNEL_M, _CHANNEL_M_MOST = 0.0025, 0.005
#: With the channels' own, a range is off by less than the 1 cm that the maker states.
_RANGE_M_MOST = 0.005
#: One sigma of a MEMS unit's scale factors and of the angles between its axes.
_IMU_SCALE, _IMU_SKEW_RAD = 1e-3, np.radians(0.03)


@dataclass(frozen=True)
class ImuUnit:
    """What a unit makes of true rate and specific force, (3, 3) each: scale factors, axes that are askew."""

    gyro: Array = field(default_factory=lambda: np.eye(3))
    accel: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class Rig:
    """One build of the car.

    cameras : models of the original, distorted images by camera.
    rig_from : ``rig_from_<sensor>`` (4, 4) by sensor (two cameras, two LiDARs).
    wheel_center_m, wheel_contact_m : (3,) in ``rig`` at rest, by wheel.
    lidar_corrections : by LiDAR.
    imu : what the IMU's axes are like.
    """

    cameras: dict[str, CameraModel]
    rig_from: dict[str, Array]
    wheel_center_m: dict[str, Array]
    wheel_contact_m: dict[str, Array]
    lidar_corrections: dict[str, LidarCorrections]
    imu: ImuUnit = field(default_factory=ImuUnit)


def lidar_elevations_rad() -> Array:
    """Nominal elevation (32,) of each channel of an XT32, top to bottom: +15 to -16 degrees."""
    return np.radians(15.0 - np.arange(CHANNELS))


def nominal_rig(width: int, height: int) -> Rig:
    """The car as drawn, its cameras with images of width x height px and 70 degrees across."""
    focal = width / 2 / np.tan(np.radians(35.0))
    camera = CameraModel(
        width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, (-0.10, 0.03, 4e-4, -3e-4, -0.004)
    )
    side = STEREO_BASELINE_M / 2
    wheels = {
        name: np.array([HALF_TRACK_M * x, y, 0.0])
        for name, x, y in (
            ("fl", -1, FRONT_AXLE_Y_M),
            ("fr", 1, FRONT_AXLE_Y_M),
            ("rl", -1, REAR_AXLE_Y_M),
            ("rr", 1, REAR_AXLE_Y_M),
        )
    }
    return Rig(
        cameras={"camera_left": camera, "camera_right": camera},
        rig_from={
            "camera_left": _camera_pose(-side, np.radians(2.0)),
            "camera_right": _camera_pose(side, np.radians(2.0)),
            "lidar_front": _lidar_pose([0.0, 0.0, 0.14], np.radians(5.0), backward=False),
            "lidar_rear": _lidar_pose([0.0, -1.95, 0.16], np.radians(15.0), backward=True),
        },
        wheel_center_m={
            name: xy + np.array([0, 0, WHEEL_RADIUS_M - RIG_HEIGHT_M]) for name, xy in wheels.items()
        },
        wheel_contact_m={name: xy + np.array([0, 0, -RIG_HEIGHT_M]) for name, xy in wheels.items()},
        lidar_corrections={name: LidarCorrections() for name in LIDARS},
    )


def built_rig(day: str, seed: int, width: int, height: int) -> Rig:
    """The car as it really is on one day (ISO date): the drawing, a little off.

    Millimetres and tenths of a degree differ. All drives and sessions of a
    day share it; the image size changes nothing else.
    """
    drawn = nominal_rig(width, height)
    rng = np.random.default_rng([seed, datetime.date.fromisoformat(day).toordinal()])
    return Rig(
        cameras={name: _built_camera(drawn.cameras[name], rng) for name in CAMERAS},
        rig_from={name: pose @ _misalignment(rng) for name, pose in drawn.rig_from.items()},
        wheel_center_m={name: xyz + rng.normal(0, BUILT_M, 3) for name, xyz in drawn.wheel_center_m.items()},
        wheel_contact_m={
            name: xyz + rng.normal(0, BUILT_M, 3) for name, xyz in drawn.wheel_contact_m.items()
        },
        lidar_corrections={name: _lidar_unit(name, seed, rng) for name in LIDARS},
        imu=_imu_unit(seed),
    )


def _lidar_unit(name: str, seed: int, day: np.random.Generator) -> LidarCorrections:
    """A unit whose channels are its own for life; its common range offset changes from day to day."""
    unit = np.random.default_rng([seed, *name.encode()])

    def off(sigma: float, most: float) -> Array:
        return np.clip(unit.normal(0, sigma, CHANNELS), -most, most)

    return LidarCorrections(
        float(day.uniform(-_RANGE_M_MOST, _RANGE_M_MOST)),
        off(_CHANNEL_M, _CHANNEL_M_MOST),
        off(_CHANNEL_RAD, _CHANNEL_RAD_MOST),
        off(_CHANNEL_RAD, _CHANNEL_RAD_MOST),
    )


def _imu_unit(seed: int) -> ImuUnit:
    unit = np.random.default_rng([seed, *b"imu"])

    def askew() -> Array:
        scale = np.diag(1 + unit.normal(0, _IMU_SCALE, 3))
        return np.asarray(scale + np.triu(unit.normal(0, _IMU_SKEW_RAD, (3, 3)), 1))

    return ImuUnit(askew(), askew())


def _camera_pose(x: float, pitch_down: float) -> Array:
    c, s = np.cos(pitch_down), np.sin(pitch_down)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, -s, -c], [0, c, -s]]).T
    pose[:3, 3] = x, 0.15, -0.05
    return pose


def _lidar_pose(origin: list[float], tilt_down: float, *, backward: bool) -> Array:
    c, s = np.cos(tilt_down), np.sin(tilt_down)
    sign = -1.0 if backward else 1.0
    pose = np.eye(4)
    pose[:3, :3] = np.array([[sign, 0, 0], [0, sign * c, -s], [0, sign * s, c]]).T
    pose[:3, 3] = origin
    return pose


def _misalignment(rng: np.random.Generator) -> Array:
    quaternion = np.concatenate([[1.0], 0.5 * rng.normal(0, BUILT_RAD, 3)])
    return transform(rng.normal(0, BUILT_M, 3), quaternion)


def _built_camera(camera: CameraModel, rng: np.random.Generator) -> CameraModel:
    zoom, shift = 1 + rng.normal(0, 0.003), rng.normal(0, 0.003, 2) * camera.width
    k1, k2, p1, p2, k3 = camera.distortion
    bend = rng.normal(0, 1, 4) * (0.004, 0.002, 1e-4, 1e-4)
    return CameraModel(
        camera.width,
        camera.height,
        camera.fx * zoom,
        camera.fy * zoom * (1 + rng.normal(0, 2e-4)),
        camera.cx + shift[0],
        camera.cy + shift[1],
        (k1 + bend[0], k2 + bend[1], p1 + bend[2], p2 + bend[3], k3),
    )
