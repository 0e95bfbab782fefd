"""A session's drive at the level of measurements: a car among planes, no ray casting."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.artifacts import write_table
from card.calibration.drive.inertial_kernels import UPPER
from card.calibration.drive.plane_kernels import CHANNELS, CORRECTIONS
from card.calibration.drive.rays import Rays
from card.calibration.drive.state import State
from card.estimation.imu import Imu, read_imu
from card.geometry import Trajectory, quaternion_from_matrix, to_json
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.recording.paths import LIDARS
from card.simulation.drawing import drawing
from card.simulation.imu import ImuErrors, imu_times, measured_imu
from card.simulation.lidar import CHANNEL_NS, PERIOD_NS, SPIN_PHASE_NS, directions
from card.simulation.rig import ImuUnit, lidar_elevations_rad, nominal_rig

Array = NDArray[np.float64]
START_NS = 1_776_156_300_000_000_000
RANGE_SIGMA_M = 0.005
DRAWN_RAD, DRAWN_M = np.radians(0.2), 0.003
#: One sigma of corrections, common range then the channels' ranges and angles.
MAKER = np.concatenate([[0.01], np.repeat([0.0025, 0.00052, 0.00052], CHANNELS)])
SCALE, SKEW = 1e-3, 0.00052
IMU_SIGMA = np.array([SCALE if i == j else SKEW for _ in range(2) for i, j in UPPER])
#: Unit normal and a point of the floor, walls and a ramp: none of them along the sides of voxels.
PLANES = [
    (np.array(normal) / np.linalg.norm(normal), np.array(point))
    for normal, point in (
        ([0.0, 0.0, 1.0], [0.0, 0.0, 0.4]),
        ([-1.0, 0.0, 0.0], [14.4, 0.0, 0.0]),
        ([1.0, 0.0, 0.0], [-13.6, 0.0, 0.0]),
        ([0.0, -1.0, 0.0], [0.0, 16.5, 0.0]),
        ([0.0, 1.0, 0.0], [0.0, -15.4, 0.0]),
        ([-0.6, -0.8, 0.0], [9.0, 12.0, 0.0]),
        ([0.5, 0.7, 0.51], [-8.0, -10.0, 0.0]),
    )
]
#: Returns nearer to a second plane than a voxel's diagonal are left out.
CLEAR_M = 1.75


@dataclass(frozen=True)
class Yard:
    """What was measured, what is true at knots, and the mountings as drawn (2, 4, 4)."""

    rays: Rays
    imu: Imu
    truth: State
    drawn: Array
    bursts: tuple[tuple[int, Burst], ...]
    imu_table: dict[str, Any]

    def write(self, folder: Path) -> None:
        """Write the drive to a folder's ``drive``."""
        drive = folder / "drive"
        for name in LIDARS:
            (drive / name).mkdir(parents=True)
        for lidar, burst in self.bursts:
            write_burst(drive / LIDARS[lidar] / f"{burst.t_ns}.laz", burst)
        write_table(drive / "imu.parquet", self.imu_table, "imu")


def yard(
    seed: int, *, seconds: float = 6.0, columns: int = 30, knot_s: float = 0.25, lively: bool = True
) -> Yard:
    """A round on a yard, over bumps; straight and level if not `lively`."""
    rng = np.random.default_rng(seed)
    path = path_of(seconds, lively)
    drawn = np.stack([nominal_rig(100, 100).rig_from[name] for name in LIDARS])
    mounted = np.stack([_built(pose, rng) for pose in drawn])
    corrections = rng.normal(size=(2, CORRECTIONS)) * MAKER
    errors = ImuErrors()
    units = np.tile(np.eye(3), (2, 1, 1))
    for k, matrix in enumerate(units):
        for u, entry in enumerate(UPPER):
            matrix[entry] += rng.normal() * IMU_SIGMA[6 * k + u]
    # The estimate's matrices undo what the unit does.
    unit = ImuUnit(np.linalg.inv(units[0]), np.linalg.inv(units[1]))
    t_ns = imu_times(START_NS, seconds)
    table = measured_imu(path, t_ns, errors, unit, rng)
    imu = read_imu(table, None)
    bursts = []
    for lidar, name in enumerate(LIDARS):
        first = START_NS + SPIN_PHASE_NS[name]
        for start in range(first, START_NS + round(seconds * 1e9) - PERIOD_NS, PERIOD_NS):
            bursts.append((lidar, _sweep(path, mounted[lidar], corrections[lidar], start, columns, rng)))
    bursts.sort(key=lambda entry: (entry[1].end_ns, entry[0]))
    knots = t_ns[np.linspace(20, len(t_ns) - 21, round(seconds / knot_s) + 1).round().astype(int)]
    truth = State(
        knots,
        path.at(knots),
        (path.at(knots + 1_000_000)[:, :3, 3] - path.at(knots - 1_000_000)[:, :3, 3]) / 2e-3,
        np.zeros((len(knots), 3)),
        np.zeros((len(knots), 3)),
        mounted,
        corrections,
        units[0],
        units[1],
    )
    return Yard(_held(bursts), imu, truth, drawn, tuple(bursts), table)


def path_of(seconds: float, lively: bool) -> Trajectory:
    """The rig's way at 1 kHz, a little longer than the drive at both ends."""
    t = np.arange(-0.1, seconds + 0.1, 1e-3)
    if lively:
        heading = 0.45 * t + 0.5 * np.sin(0.9 * t)
        xy = np.stack([7 * np.cos(heading), 6 * np.sin(heading)], axis=1)
        pitch, roll = 0.03 * np.sin(5.1 * t), 0.025 * np.sin(3.7 * t + 1)
        up = 2.1 + 0.03 * np.sin(6.3 * t)
    else:
        heading, xy = np.zeros_like(t), np.stack([np.zeros_like(t), t - 3], axis=1)
        pitch, roll, up = np.zeros_like(t), np.zeros_like(t), np.full_like(t, 2.1)
    rotation = Rotation.from_euler("ZXY", np.stack([heading, pitch, roll], axis=1))
    t_ns = START_NS + np.round(t * 1e9).astype(np.int64)
    return Trajectory(t_ns, np.column_stack([xy, up]), quaternion_from_matrix(rotation.as_matrix()))


def _built(pose: Array, rng: np.random.Generator) -> Array:
    result = pose.copy()
    result[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(rng.normal(0, DRAWN_RAD, 3)).as_matrix()
    result[:3, 3] += rng.normal(0, DRAWN_M, 3)
    return result


def _sweep(
    path: Trajectory, mounted: Array, corrections: Array, start: int, columns: int, rng: np.random.Generator
) -> Burst:
    fired = np.arange(columns) * (PERIOD_NS // columns)
    azimuth = (fired / PERIOD_NS * 2 * np.pi + rng.uniform(0, 0.1)).repeat(CHANNELS)
    ring = np.tile(np.arange(CHANNELS), columns)
    offset = fired.repeat(CHANNELS) + ring * CHANNEL_NS
    elevation = lidar_elevations_rad()[ring]
    channel = corrections[1:].reshape(3, CHANNELS)
    true = directions(azimuth + channel[2, ring], elevation + channel[1, ring])
    pose = path.at(start + offset) @ mounted
    away = np.einsum("nij,nj->ni", pose[:, :3, :3], true)
    origin = pose[:, :3, 3]
    distances = np.stack([((point - origin) @ normal) / (away @ normal) for normal, point in PLANES])
    distance = np.where(distances > 0, distances, np.inf).min(axis=0)
    hit = origin + distance[:, None] * away
    # No voxel shall hold two planes: what the estimate makes of corners is for simulated drives to tell.
    beside = np.sort([np.abs((hit - point) @ normal) for normal, point in PLANES], axis=0)[1] > CLEAR_M
    measured = distance - corrections[0] - channel[0, ring] + rng.normal(0, RANGE_SIGMA_M, len(ring))
    seen = beside & (distance > 1.0) & (distance < 60.0)
    points = (measured[:, None] * directions(azimuth, elevation))[seen]
    ones = np.full(int(seen.sum()), 100, dtype=np.uint8)
    return Burst(start, points, ones, ring[seen].astype(np.uint8), offset[seen].astype(np.uint32))


def _held(bursts: list[tuple[int, Burst]]) -> Rays:
    counts = [len(burst) for _, burst in bursts]
    lidar = np.array([lidar for lidar, _ in bursts], dtype=np.int8)
    return Rays(
        np.concatenate([burst.points for _, burst in bursts]),
        np.concatenate([burst.ring for _, burst in bursts]),
        np.concatenate([burst.time_ns for _, burst in bursts]),
        lidar.repeat(counts),
        lidar,
        np.array([burst.t_ns for _, burst in bursts]),
        np.array([burst.end_ns for _, burst in bursts]),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )


def drawing_document(drawn: Array) -> dict[str, Any]:
    """The drawing of the simulated car with mountings (2, 4, 4)."""
    document = drawing("tiny")
    for name, pose in zip(LIDARS, drawn, strict=True):
        sigmas = {"sigma_rad": DRAWN_RAD, "sigma_m": DRAWN_M}
        document["extrinsics"][f"rig_from_{name}"] = {**to_json(pose), **sigmas}
    return document
