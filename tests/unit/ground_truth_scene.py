"""A small analytic drive for the tests of the ground truth: boxes on a plane, two LiDARs, one camera."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml

from card.artifacts import write_json, write_table
from card.geometry import Trajectory, to_json, transform
from card.recording.burst import Burst
from card.recording.laz import write_burst

GROUND_Z = -1.2
PERIOD_NS = 100_000_000
START_NS = 1_000_000_000
ELEVATIONS = np.radians(np.linspace(15, -16, 32))
RIG_FROM = {
    "lidar_front": transform((0.0, 1.0, 0.7)),
    # Turned by half a turn: its own forward is the car's backward.
    "lidar_rear": transform((0.0, -1.0, 0.7), (0.0, 0.0, 0.0, 1.0)),
    # OpenCV axes, looking along +y of the rig.
    "camera_left": transform((-0.2, 0.5, 0.4), (np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0)),
}
NO_CORRECTION = {
    "range_offset_m": 0.0,
    "channel_range_offset_m": [0.0] * 32,
    "channel_elevation_offset_rad": [0.0] * 32,
    "channel_azimuth_offset_rad": [0.0] * 32,
}
Box = tuple[np.ndarray, np.ndarray]


def straight(seconds: float, speed: float, origin: tuple[float, float, float] = (0, 0, 0)) -> Trajectory:
    """A drive along +y at a constant speed (m/s), a pose every 10 ms, one second of margin on both sides."""
    t = np.arange(0, round((seconds + 2) * 100)) * 10_000_000
    y = speed * (t / 1e9 - 1)
    place = np.stack([0 * y, y, 0 * y], axis=1) + origin
    return Trajectory(t, place, np.tile([1.0, 0, 0, 0], (len(t), 1)))


def cast(origins: np.ndarray, directions: np.ndarray, boxes: list[Box]) -> np.ndarray:
    """Range (N,) to the ground or the nearest box (low, high corner), inf where there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = (GROUND_Z - origins[:, 2]) / directions[:, 2]
        best = np.where(ground > 0, ground, np.inf)
        for low, high in boxes:
            a, b = (low - origins) / directions, (high - origins) / directions
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            best = np.where((enter < leave) & (enter > 0), np.minimum(best, enter), best)
    return np.where(best < 60, best, np.inf)


def sweep(lidar: str, t_ns: int, trajectory: Trajectory, columns: int, boxes: list[Box]) -> Burst:
    """One sweep as the moving sensor measures it, with 5 mm of range noise."""
    azimuth = np.repeat(np.arange(columns) / columns * 2 * np.pi, len(ELEVATIONS))
    ring = np.tile(np.arange(len(ELEVATIONS)), columns)
    offset = (azimuth / (2 * np.pi) * (PERIOD_NS - 1_000_000)).astype(np.uint32)
    level = np.cos(ELEVATIONS[ring])
    directions = np.stack(
        [level * np.sin(azimuth), level * np.cos(azimuth), np.sin(ELEVATIONS[ring])], axis=1
    )
    world_from = trajectory.at(t_ns + offset.astype(np.int64)) @ RIG_FROM[lidar]
    distance = cast(world_from[:, :3, 3], np.einsum("nij,nj->ni", world_from[:, :3, :3], directions), boxes)
    hit = np.isfinite(distance)
    noise = np.random.default_rng(t_ns).normal(0, 0.005, hit.sum())
    points = directions[hit] * (distance[hit] + noise)[:, None]
    return Burst(t_ns, points, np.full(hit.sum(), 40, np.uint8), ring[hit].astype(np.uint8), offset[hit])


def write_drive(
    folder: Path,
    *,
    bursts: int,
    columns: int,
    speed: float,
    boxes: Callable[[float], list[Box]],
    frames: list[float],
    lidars: tuple[str, ...] = ("lidar_front", "lidar_rear"),
) -> dict[str, Path]:
    """Write everything `aggregate` reads; `boxes` gives the boxes at a time (s), `frames` are times (s)."""
    recording = folder / "recording"
    trajectory = straight(bursts * PERIOD_NS / 1e9, speed)
    rows: dict[str, list] = {k: [] for k in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")}
    for lidar in lidars:
        (recording / lidar).mkdir(parents=True)
        for k in range(bursts):
            t_ns = START_NS + k * PERIOD_NS
            burst = sweep(lidar, t_ns, trajectory, columns, boxes((t_ns - START_NS) / 1e9))
            write_burst(recording / lidar / f"{t_ns}.laz", burst)
            values = (lidar, k, t_ns, burst.end_ns, len(burst), f"{lidar}/{t_ns}.laz")
            for column, value in zip(rows.values(), values, strict=True):
                column.append(value)
    times = [START_NS + round(t * 1e9) for t in frames]
    following = [
        next((k for k in range(bursts) if START_NS + k * PERIOD_NS + 99_000_000 > t), None) for t in times
    ]
    write_table(folder / "bursts.parquet", rows, "bursts")
    write_table(
        folder / "frames.parquet",
        {
            "frame": np.arange(len(times), dtype=np.int32),
            "t_ns": times,
            "left_file": [f"camera_left/{t}.jpg" for t in times],
            "right_file": [None] * len(times),
            "right_t_ns": [None] * len(times),
            "lidar_front_burst": following,
            "lidar_rear_burst": following,
        },
        "frames",
    )
    write_table(folder / "trajectory.parquet", trajectory.to_table(), "trajectory")
    write_json(folder / "calibration.json", calibration(), "calibration")
    write_mask(folder / "ego_mask.png")
    sensor = {"model": "analytic", "clock": "synchronised", "deskewed": False}
    description = {
        "id": "scene",
        "rig": "test",
        "day": "2026-01-01",
        "place": "nowhere",
        "country": "DE",
        "sensors": dict.fromkeys(lidars, sensor),
    }
    (recording / "recording.yaml").write_text(yaml.safe_dump(json.loads(json.dumps(description))))
    return {
        "recording": recording,
        "bursts": folder / "bursts.parquet",
        "frames": folder / "frames.parquet",
        "calibration": folder / "calibration.json",
        "ego_mask": folder / "ego_mask.png",
        "trajectory": folder / "trajectory.parquet",
    }


def calibration() -> dict:
    """A calibration of 200 x 160 images with a little distortion."""
    pinhole = {"width": 200, "height": 160, "fx": 120.0, "fy": 120.0, "cx": 99.5, "cy": 79.5}
    camera = {**pinhole, "model": "brown5", "distortion": [-0.05, 0.01, 0.0005, -0.0005, 0.0]}
    extrinsics = {f"rig_from_{name}": to_json(matrix) for name, matrix in RIG_FROM.items()}
    extrinsics["rig_from_camera_right"] = to_json(transform((0.2, 0.5, 0.4), (0.5**0.5, -(0.5**0.5), 0, 0)))
    wheel = {"center_m": [0.0, 0.0, -0.9], "contact_m": [0.0, 0.0, GROUND_Z]}
    return {
        "schema": "calibration",
        "session": {"id": "s", "day": "2026-01-01", "mode": "import"},
        "cameras": {"camera_left": camera, "camera_right": camera},
        "camera_left_undistorted": pinhole,
        "extrinsics": extrinsics,
        "wheels": dict.fromkeys(("fl", "fr", "rl", "rr"), wheel),
        "lidar_corrections": {"lidar_front": NO_CORRECTION, "lidar_rear": NO_CORRECTION},
        "covariances": {},
        "quality": {"stereo_reprojection_px": 0.1, "board_plane_rms_m": 0.001, "views": 10},
    }


def write_mask(path: Path, width: int = 200, height: int = 160) -> None:
    """An ego mask whose lowest tenth is the car's own body."""
    import cv2

    mask = np.zeros((height, width), np.uint8)
    mask[height - height // 10 :] = 255
    cv2.imwrite(str(path), mask)
