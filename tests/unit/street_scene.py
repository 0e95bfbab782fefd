"""A street of boxes that a LiDAR-inertial drive goes through: closed-form rays, motion and IMU."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from card.artifacts import write_json, write_table
from card.geometry import Trajectory, transform
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.simulation.calibrations import true_calibration
from card.simulation.rig import ImuUnit, lidar_elevations_rad

START_NS = 1_776_153_600_000_000_000
PERIOD_NS = 100_000_000
GRAVITY = np.array([0, 0, 9.81])
WXYZ = [3, 0, 1, 2]
PHASE_NS = {"lidar_front": 3_000_000, "lidar_rear": 45_000_000}
GROUND = -1.7
UNIT = ImuUnit(
    np.array([[1.01, -4e-3, 6e-3], [0, 0.992, 5e-3], [0, 0, 0.985]]),
    np.array([[0.99, 5e-3, -6e-3], [0, 1.01, 4e-3], [0, 0, 1.006]]),
)
Motion = Callable[[np.ndarray], tuple[np.ndarray, Rotation]]


def houses(length: float = 160.0, gap: float = 16.0, seed: int = 0) -> np.ndarray:
    """Boxes (B, 2, 3), low and high corners: houses and poles of many sizes on both sides of the y axis."""
    rng = np.random.default_rng(seed)
    boxes = []
    for y in np.arange(-40.0, length, gap):
        for side in (-1, 1):
            near, depth, width, height = (
                6 + rng.uniform(0, 3),
                rng.uniform(4, 8),
                rng.uniform(6, 12),
                rng.uniform(3, 9),
            )
            x = sorted((side * near, side * (near + depth)))
            boxes.append([[x[0], y, GROUND], [x[1], y + width, GROUND + height]])
            pole = side * 4.5
            boxes.append([[pole - 0.1, y + 13, GROUND], [pole + 0.1, y + 13.2, GROUND + 5]])
    return np.array(boxes)


def tunnel(length: float = 400.0) -> np.ndarray:
    """Two walls and a ceiling without any feature along y."""
    y = (-length, length)
    return np.array(
        [
            [[-5.0, y[0], GROUND], [-4.5, y[1], 4.0]],
            [[4.5, y[0], GROUND], [5.0, y[1], 4.0]],
            [[-5.0, y[0], 3.5], [5.0, y[1], 4.0]],
        ]
    )


def trunks(length: float = 80.0, gap: float = 8.0) -> np.ndarray:
    """Nothing but trunks half a metre thick on both sides, in three rows."""
    boxes = []
    for i, y in enumerate(np.arange(-40.0, length, gap)):
        for side in (-1, 1):
            x = side * 6.0 + 2.5 * (i % 3) * side
            boxes.append([[x - 0.25, y - 0.25, GROUND], [x + 0.25, y + 0.25, GROUND + 6]])
    return np.array(boxes)


def swaying(speed: float = 6.0, turn: float = 0.0, heave: float = 0.02) -> Motion:
    """Constant speed along y, or on a circle for a turn rate in rad/s, the body swaying."""

    def motion(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
        yaw = turn * t
        if turn:
            x, y = speed / turn * (np.cos(yaw) - 1), speed / turn * np.sin(yaw)
        else:
            x, y = 0 * t, speed * t
        position = np.stack([x, y, heave * np.sin(4 * t)], axis=1)
        body = np.stack([yaw, heave * np.sin(3 * t), 1.5 * heave * np.sin(2.2 * t)], axis=1)
        return position, Rotation.from_euler("ZXY", body)

    return motion


def standing(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """A parked car."""
    return np.zeros((len(t), 3)), Rotation.from_rotvec(np.zeros((len(t), 3)))


@dataclass(frozen=True)
class Street:
    """What a drive is made of; `record` writes it down.

    gyro_bias, accel_bias : (3,) SI, of the corrected IMU.  unit : its scales and axes.  imu_delay_s : how
    late the IMU's stamps are.  lidars : those on board.
    """

    boxes: np.ndarray
    motion: Motion
    seconds: float = 4.0
    columns: int = 180
    range_noise: float = 0.005
    gyro_bias: np.ndarray = field(default_factory=lambda: np.array([1e-3, -5e-4, 8e-4]))
    accel_bias: np.ndarray = field(default_factory=lambda: np.array([0.02, -0.01, 0.015]))
    unit: ImuUnit = UNIT
    imu_delay_s: float = 0.0
    lidars: tuple[str, ...] = ("lidar_front",)
    seed: int = 0

    def poses(self, t_ns: np.ndarray) -> np.ndarray:
        """True world_from_rig (N, 4, 4)."""
        position, rotation = self.motion((t_ns - START_NS) * 1e-9)
        return transform(position, rotation.as_quat()[:, WXYZ])

    def truth(self, t_ns: np.ndarray) -> Trajectory:
        """The same as a trajectory."""
        position, rotation = self.motion((t_ns - START_NS) * 1e-9)
        return Trajectory(t_ns, position, rotation.as_quat()[:, WXYZ])

    def imu(self) -> dict[str, np.ndarray]:
        """Columns of schema ``imu`` at 200 Hz, with white noise of a good MEMS unit and constant biases."""
        rng = np.random.default_rng([self.seed, 1])
        t = np.arange(0, self.seconds + 0.0025, 0.005)
        step = 1e-4
        (before, r0), (now, r), (after, r1) = (self.motion(t + d) for d in (-step, 0, step))
        gyro = (r0.inv() * r1).as_rotvec() / (2 * step) + self.gyro_bias
        accel = r.inv().apply((after - 2 * now + before) / step**2 + GRAVITY) + self.accel_bias
        gyro = (gyro + rng.normal(0, 1e-4 * np.sqrt(200), gyro.shape)) @ self.unit.gyro.T
        accel = (accel + rng.normal(0, 1e-3 * np.sqrt(200), accel.shape)) @ self.unit.accel.T
        columns = {"t_ns": START_NS + np.round((t + self.imu_delay_s) * 1e9).astype(np.int64)}
        for i, axis in enumerate("xyz"):
            columns |= {f"gyro_{axis}": gyro[:, i], f"accel_{axis}": accel[:, i]}
        return columns

    def burst(self, lidar: str, number: int, rig_from_lidar: np.ndarray, corrections: dict) -> Burst:
        """One sweep."""
        rng = np.random.default_rng([self.seed, 2, number, *lidar.encode()])
        t_ns = START_NS + number * PERIOD_NS + PHASE_NS[lidar]
        step = PERIOD_NS // self.columns
        column = np.repeat(np.arange(self.columns), 32)
        ring = np.tile(np.arange(32), self.columns)
        offset = (column * step + ring * 1512).astype(np.uint32)
        azimuth, elevation = 2 * np.pi * column / self.columns, lidar_elevations_rad()[ring]
        flat = np.cos(elevation)
        ray = np.stack([flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(elevation)], axis=1)
        pose = self.poses(t_ns + offset.astype(np.int64)) @ rig_from_lidar
        distance = cast(self.boxes, pose[:, :3, 3], np.einsum("nij,nj->ni", pose[:, :3, :3], ray))
        seen = np.isfinite(distance) & (distance < 110)
        measured = distance - corrections["range_offset_m"] + rng.normal(0, self.range_noise, len(distance))
        points = measured[seen, None] * ray[seen]
        return Burst(
            t_ns, points, np.full(len(points), 9, np.uint8), ring[seen].astype(np.uint8), offset[seen]
        )

    def record(self, folder: Path) -> Path:
        """recording.yaml, imu.parquet, sweeps of the LiDARs, calibration.json and bursts.parquet."""
        folder.mkdir(parents=True, exist_ok=True)
        calibration = true_calibration("2026-04-14-start", 1, "tiny")
        # The boxes are measured without error: nothing is to be corrected.
        for corrections in calibration["lidar_corrections"].values():
            corrections |= {name: 0.0 if name == "range_offset_m" else [0.0] * 32 for name in corrections}
        calibration["imu_corrections"] = {
            name: np.linalg.inv(matrix).tolist()
            for name, matrix in (("gyro", self.unit.gyro), ("accel", self.unit.accel))
        }
        lidar = {"model": "XT32", "clock": "synchronised", "deskewed": False}
        imu = {"model": "IMU", "clock": "synchronised"}
        description = {"id": "street", "rig": "r", "day": "2026-04-14", "place": "p", "country": "DE"}
        description["sensors"] = {**dict.fromkeys(self.lidars, lidar), "imu": imu}
        (folder / "recording.yaml").write_text(yaml.safe_dump(description))
        write_json(folder / "calibration.json", calibration, "calibration")
        write_table(folder / "imu.parquet", self.imu(), "imu")
        rows = []
        for name in self.lidars:
            extrinsic = calibration["extrinsics"][f"rig_from_{name}"]
            rig_from_lidar = transform(extrinsic["translation_m"], extrinsic["rotation_wxyz"])
            corrections = calibration["lidar_corrections"][name]
            (folder / name).mkdir()
            for number in range(round(self.seconds * 10) - 1):
                burst = self.burst(name, number, rig_from_lidar, corrections)
                file = f"{name}/{burst.t_ns}.laz"
                write_burst(folder / file, burst)
                rows.append((name, number, burst.t_ns, burst.end_ns, len(burst), file))
        names = ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")
        columns = {
            column: list(values) for column, values in zip(names, zip(*rows, strict=True), strict=True)
        }
        write_table(folder / "bursts.parquet", columns, "bursts")
        return folder


def cast(boxes: np.ndarray, origin: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """Distances (N,) of rays (N, 3) to the ground or the nearest box, inf for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = (GROUND - origin[:, 2]) / ray[:, 2]
        nearest = np.where(ground > 0, ground, np.inf)
        for low, high in boxes:
            a, b = (low - origin) / ray, (high - origin) / ray
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            hit = (enter > 0) & (enter < leave) & (enter < nearest)
            nearest = np.where(hit, enter, nearest)
    return nearest
