"""Corridor points of one burst: what cropping must not change."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from card.geometry import Trajectory, apply, inverse
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.wheels.arc_height import Corridor, corridor_points
from card.wheels.contact_path import contact_path
from card.wheels.samples import BurstFile, Cutter, Lidar, collect_samples
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
    burst = BurstFile("lidar_front", t_ns, tmp_path / f"{t_ns}.laz")
    (found,) = collect_samples([burst], cutter, threads=1)
    wanted = corridor_points(world, contact, (0.0, 30.0), corridor)
    assert len(wanted) == 200
    # Stored to 0.1 mm.
    np.testing.assert_allclose(found.arc, wanted.arc, atol=2e-4)
    np.testing.assert_allclose(found.sideways, wanted.sideways, atol=2e-4)
    np.testing.assert_allclose(found.height, wanted.height, atol=2e-4)
