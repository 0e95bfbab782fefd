"""Corridor points of one burst: what cropping must not change."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from card.estimation.deskew import deskew_plain
from card.geometry import Trajectory, apply, inverse, transform
from card.recording.burst import Burst
from card.recording.laz import read_burst, write_burst
from card.wheels.arc_height import Corridor, corridor_points
from card.wheels.contact_path import contact_path
from card.wheels.corridor_kernels import near_cells
from card.wheels.samples import BurstFile, Cutter, Lidar, collect_samples, spaced_bursts
from card.wheels.static_points import StaticVoxels

START_NS = 1_776_153_600_000_000_000
VOXEL_M = 0.1


def trajectory() -> Trajectory:
    """Four seconds at 5 m/s of a car that pitches."""
    t = np.arange(0, 4, 0.01)
    quaternion = Rotation.from_euler("X", (0.02 + 0.01 * np.sin(4 * t))[:, None]).as_quat()[:, [3, 0, 1, 2]]
    position = np.stack([np.zeros_like(t), 5 * t, np.full_like(t, 1.7)], axis=1)
    return Trajectory(START_NS + np.round(t * 1e9).astype(np.int64), position, quaternion)


@pytest.mark.parametrize("deskewed", [False, True])
def test_a_burst_that_is_cropped_keeps_its_own_end(tmp_path: Path, deskewed: bool) -> None:
    """Corridor points come early in the sweep; a deskewed burst still has the pose of the sweep's end."""
    path = trajectory()
    contact = contact_path(path, [0.8, 1.0, -1.7], 0.05)
    rig_from_lidar = np.eye(4)
    rng = np.random.default_rng(1)
    arc = rng.uniform(10, 14, 200)
    world = np.concatenate([contact.surface(arc, rng.uniform(-0.1, 0.1, 200)), [[40.0, 30.0, 2.0]]])
    # The stray point is the last one and lies outside the corridor.
    offset = np.append(np.sort(rng.integers(0, 10_000_000, 200)), 99_000_000).astype(np.uint32)
    t_ns = START_NS + 1_500_000_000
    times = np.full(201, t_ns + 99_000_000) if deskewed else t_ns + offset.astype(np.int64)
    points = apply(inverse(path.at(times) @ rig_from_lidar), world)
    grey = np.zeros(201, dtype=np.uint8)
    write_burst(tmp_path / f"{t_ns}.laz", Burst(t_ns, points, grey, grey, offset))
    corrections = {
        "range_offset_m": 0.0,
        **{
            f"channel_{name}": [0.0] * 32
            for name in ("range_offset_m", "elevation_offset_rad", "azimuth_offset_rad")
        },
    }
    arrays = {"origin": np.zeros(3), "voxel_size": np.float64(VOXEL_M)}
    arrays["ids"] = np.unique(np.floor(world / VOXEL_M).astype(np.int32), axis=0)
    corridor = Corridor(0.12, 0.35)
    cutter = Cutter(
        {"lidar_front": Lidar(rig_from_lidar, corrections, deskewed)},
        path,
        [contact],
        StaticVoxels(arrays),
        1,
        corridor,
        12.0,
    )
    burst = BurstFile("lidar_front", t_ns, 1, f"{tmp_path}/{t_ns}.laz")
    (found,) = collect_samples([burst], cutter, threads=1)
    wanted, _ = corridor_points(world, contact, (0.0, 30.0), corridor)
    assert len(wanted) == 200
    # Stored to 0.1 mm.
    np.testing.assert_allclose(found.arc, wanted.arc, atol=2e-4)
    np.testing.assert_allclose(found.sideways, wanted.sideways, atol=2e-4)
    np.testing.assert_allclose(found.height, wanted.height, atol=2e-4)


def turning() -> Trajectory:
    """Four seconds at 5 m/s round a circle of 4 m."""
    t = np.arange(0, 4, 0.01)
    yaw = 5 * t / 4
    quaternion = Rotation.from_euler("Z", yaw[:, None]).as_quat()[:, [3, 0, 1, 2]]
    position = np.stack([4 * np.cos(yaw) - 4, 4 * np.sin(yaw), np.full_like(t, 1.7)], axis=1)
    return Trajectory(START_NS + np.round(t * 1e9).astype(np.int64), position, quaternion)


def shunting() -> Trajectory:
    """Forward at 5 m/s, standing while the burst is taken, and back."""
    t = np.arange(0, 4, 0.01)
    y = np.interp(t, [0, 1.4, 1.7, 4], [0, 7, 7, 1])
    still = np.tile([1.0, 0, 0, 0], (len(t), 1))
    position = np.stack([0 * t, y, np.full_like(t, 1.7)], axis=1)
    return Trajectory(START_NS + np.round(t * 1e9).astype(np.int64), position, still)


def racing() -> Trajectory:
    """Four seconds at 38 m/s, 4 m between the sweep's first point and its last."""
    t = np.arange(0, 4, 0.01)
    still = np.tile([1.0, 0, 0, 0], (len(t), 1))
    position = np.stack([0 * t, 38 * t, np.full_like(t, 1.7)], axis=1)
    return Trajectory(START_NS + np.round(t * 1e9).astype(np.int64), position, still)


@pytest.mark.parametrize("drive", [trajectory, turning, shunting, racing])
def test_cut_points_are_those_of_the_plain_way(tmp_path: Path, drive: Callable[[], Trajectory]) -> None:
    """Reference: nothing cropped, every point deskewed, static ones first, nearest poses by a tree."""
    rng = np.random.default_rng(4)
    path = drive()
    rig_from_lidar = transform(
        [0.1, 0.5, 0.2], Rotation.from_euler("ZX", [0.3, -0.02]).as_quat()[[3, 0, 1, 2]]
    )
    offset = np.sort(rng.integers(0, 100_000_000, 20_000)).astype(np.uint32)
    t_ns = START_NS + 1_500_000_000
    beside = np.linalg.norm(path.translation_m - path.at(t_ns)[:3, 3], axis=1) < 10
    place = rng.choice(path.translation_m[beside], 20_000) - [0, 0, 1.7]
    world = place + rng.uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 0.5], (20_000, 3))
    sensor = apply(inverse(path.at(t_ns + offset.astype(np.int64)) @ rig_from_lidar), world)
    ring = rng.integers(0, 32, 20_000).astype(np.uint8)
    write_burst(tmp_path / f"{t_ns}.laz", Burst(t_ns, sensor, ring, ring, offset))
    names = ("range_offset_m", "elevation_offset_rad", "azimuth_offset_rad")
    corrections = {f"channel_{name}": rng.normal(0, 1e-3, 32).tolist() for name in names}
    corrections |= {"range_offset_m": 0.01}
    ids = np.unique(np.floor(world[::3] / VOXEL_M).astype(np.int32), axis=0)
    static = StaticVoxels({"origin": np.zeros(3), "voxel_size": np.float64(VOXEL_M), "ids": ids})
    corridor, reach_m = Corridor(0.12, 0.35, 0.17), 6.0
    paths = [contact_path(path, contact, 0.05) for contact in ([0.8, 1.0, -1.7], [-0.8, -1.5, -1.7])]
    lidar = Lidar(rig_from_lidar, corrections, False)
    cutter = Cutter({"lidar_front": lidar}, path, paths, static, 1, corridor, reach_m)
    found = cutter.cut([BurstFile("lidar_front", t_ns, 1, f"{tmp_path}/{t_ns}.laz")])

    points = deskew_plain(read_burst(tmp_path / f"{t_ns}.laz"), rig_from_lidar, path, corrections)
    points = points[static.near(points, 1)]
    for road, wheel in zip(found, paths, strict=True):
        arc = float(wheel.arc_at(t_ns))
        plain, _ = corridor_points(points, wheel, (arc - reach_m, arc + reach_m), corridor, compiled=False)
        assert 100 < len(plain) == len(road)
        assert len(set(road.run)) == (2 if drive is shunting else 1)
        for name in ("arc", "sideways", "height", "run"):
            np.testing.assert_allclose(getattr(road, name), getattr(plain, name), rtol=0, atol=1e-10)


def test_cells_near_a_place_are_its_own_and_those_beside() -> None:
    rng = np.random.default_rng(5)
    seen, points = rng.uniform(-4, 4, (30, 2)), rng.uniform(-7, 7, (5000, 3))
    cells, places = np.floor(points[:, :2] / 0.6), np.floor(seen / 0.6)
    wanted = (np.abs(cells[:, None] - places).max(axis=2) <= 1).any(axis=1)
    np.testing.assert_array_equal(near_cells(points, seen, 0.6), np.flatnonzero(wanted))
    assert 0.1 < wanted.mean() < 0.9


@pytest.mark.parametrize(("points", "step_m"), [(40_000, 1.0), (20, 0.05)])
def test_bursts_are_as_far_apart_as_their_points_reach(points: int, step_m: float) -> None:
    """And none is read while the car stands."""
    t = np.arange(0, 8, 0.01)
    y = np.interp(t, [0, 2, 4, 6, 8], [0, 10, 10, 4, 4])  # 5 m/s, stands, back at 3 m/s, stands
    position = np.stack([np.zeros_like(t), y, np.full_like(t, 1.7)], axis=1)
    still = np.tile([1.0, 0, 0, 0], (len(t), 1))
    path = contact_path(
        Trajectory(START_NS + np.round(t * 1e9).astype(np.int64), position, still), [0.8, 1.0, -1.7], 0.05
    )
    bursts = [
        BurstFile(lidar, START_NS + number * 100_000_000, points, "b")
        for number in range(78)
        for lidar in ("lidar_front", "lidar_rear")
    ]
    kept = spaced_bursts(bursts, path, 40_000, 0.05)
    for lidar in ("lidar_front", "lidar_rear"):
        arc = path.arc_at([burst.t_start_ns for burst in kept if burst.lidar == lidar])
        assert arc[0] == 0
        assert np.diff(arc).min() >= step_m - 1e-9
        assert np.diff(arc).max() < step_m + 0.5 + 1e-9
        # Every metre to 10 m and every 1.2 m back; or every sweep in motion.
        assert len(arc) == (11 + 5 if step_m == 1.0 else 21 + 20)
