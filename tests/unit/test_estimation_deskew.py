"""Corrections and motion compensation of a burst against closed forms."""

import numpy as np
import pytest

from card.errors import CardError
from card.estimation.deskew import deskew_burst
from card.geometry import Trajectory, apply, transform
from card.geometry.corrections import correct_points
from card.recording.burst import Burst

START_NS = 1_776_153_600_000_000_000
RIG_FROM_LIDAR = transform([0.1, 0.2, 0.3], [0.9, 0.1, -0.2, 0.3])


def turning() -> Trajectory:
    """A second at 20 m/s that turns about z at 0.4 rad/s."""
    s = np.arange(101) / 100
    zeros = np.zeros_like(s)
    rotation = np.stack([np.cos(0.2 * s), zeros, zeros, np.sin(0.2 * s)], axis=1)
    times = START_NS + np.arange(101) * 10_000_000
    return Trajectory(times, np.stack([zeros, 20 * s, zeros], axis=1), rotation)


def burst(count: int = 50) -> Burst:
    rng = np.random.default_rng(0)
    offset = np.sort(rng.integers(0, 100_000_000, count)).astype(np.uint32)
    grey = np.zeros(count, dtype=np.uint8)
    return Burst(START_NS + 200_000_000, rng.normal(0, 10, (count, 3)), grey, grey, offset)


def polar(r: float, azimuth_deg: float, elevation_deg: float) -> list[float]:
    """Azimuth from y towards x: clockwise seen from above."""
    az, el = np.radians([azimuth_deg, elevation_deg])
    return [r * np.cos(el) * np.sin(az), r * np.cos(el) * np.cos(az), r * np.sin(el)]


def test_corrections_are_added_to_what_was_measured() -> None:
    channel = {f"channel_{name}": np.zeros(32) for name in ("range_offset_m", "elevation_offset_rad")}
    corrections = {"range_offset_m": 0.03, "channel_azimuth_offset_rad": np.zeros(32), **channel}
    corrections["channel_range_offset_m"][4] = -0.01
    corrections["channel_elevation_offset_rad"][5] = np.radians(0.2)
    corrections["channel_azimuth_offset_rad"][6] = np.radians(0.5)
    measured = np.array([polar(10, 170, -9), polar(20, -60, 3), polar(30, 40, -16), polar(40, 90, 15)])
    corrected = correct_points(measured, np.array([3, 4, 5, 6], dtype=np.uint8), corrections)
    wanted = [polar(10.03, 170, -9), polar(20.02, -60, 3), polar(30.03, 40, -15.8), polar(40.03, 90.5, 15)]
    np.testing.assert_allclose(corrected, wanted, atol=1e-12)


def test_each_point_takes_the_pose_of_its_own_time() -> None:
    one, path = burst(), turning()
    poses = path.at(one.time_ns) @ RIG_FROM_LIDAR
    np.testing.assert_allclose(deskew_burst(one, RIG_FROM_LIDAR, path), apply(poses, one.points), atol=1e-9)


@pytest.mark.parametrize("part", [slice(None), slice(0, 20)])
def test_a_part_of_a_deskewed_burst_takes_the_pose_of_the_whole_one_s_end(part: slice) -> None:
    whole, path = burst(), turning()
    columns = (whole.points, whole.intensity, whole.ring, whole.offset_ns)
    cut = Burst(whole.t_ns, *(column[part] for column in columns))
    world = deskew_burst(cut, RIG_FROM_LIDAR, path, motion_compensate=False, end_ns=whole.end_ns)
    np.testing.assert_allclose(
        world, apply(path.at(whole.end_ns) @ RIG_FROM_LIDAR, whole.points[part]), atol=1e-9
    )


def test_poses_that_do_not_cover_the_end_are_refused() -> None:
    with pytest.raises(CardError, match="poses do not cover the burst"):
        deskew_burst(
            burst(), RIG_FROM_LIDAR, turning(), motion_compensate=False, end_ns=START_NS + 1_000_000_001
        )
