"""Corrections and motion compensation of a burst against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import DataObject, booleans, data, floats, integers, sampled_from

from card.errors import CardError
from card.estimation.deskew import deskew_burst, deskew_plain, turns_of
from card.estimation.deskew_kernel import corrected
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


channel_offsets = arrays(np.float64, 32, elements=floats(-0.05, 0.05))


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
    found = correct_points(measured, np.array([3, 4, 5, 6], dtype=np.uint8), corrections)
    wanted = [polar(10.03, 170, -9), polar(20.02, -60, 3), polar(30.03, 40, -15.8), polar(40.03, 90.5, 15)]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(data())
def test_the_compiled_corrections_are_the_plain_ones(draw: DataObject) -> None:
    rng = np.random.default_rng(draw.draw(integers(0, 2**32 - 1)))
    names = ("range_offset_m", "elevation_offset_rad", "azimuth_offset_rad")
    corrections = {f"channel_{name}": draw.draw(channel_offsets) for name in names} | {"range_offset_m": 0.02}
    points, ring = rng.normal(0, 10, (40, 3)), rng.integers(0, 32, 40).astype(np.uint8)
    points[0], points[1, :2] = 0.0, 0.0
    plain = correct_points(points, ring, corrections)
    np.testing.assert_allclose(corrected(points, ring, turns_of(corrections)), plain, atol=1e-12)


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


def test_a_burst_that_ends_after_the_poses_is_refused_whatever_end_is_given() -> None:
    late = burst()
    path = turning()
    short = Trajectory(path.t_ns[:25], path.translation_m[:25], path.rotation_wxyz[:25])
    with pytest.raises(CardError, match="poses do not cover the burst"):
        deskew_burst(late, RIG_FROM_LIDAR, short, end_ns=late.t_ns)


@settings(max_examples=60, deadline=None)
@given(data())
def test_the_compiled_path_places_points_where_the_plain_one_does(draw: DataObject) -> None:
    """Any sweep, sorted in time or not, over any poses, dense or sparse, still or turning, near or far."""
    count = draw.draw(integers(0, 40))
    rng = np.random.default_rng(draw.draw(integers(0, 2**32 - 1)))
    knots = draw.draw(integers(2, 30))
    gaps = rng.integers(1_000_000, 20_000_000, knots)
    times = START_NS + np.cumsum(gaps)
    turn = draw.draw(sampled_from([0.0, 1e-7, 1e-3, 0.3]))
    rotation = np.cumsum(np.r_[rng.normal(size=(1, 4)), rng.normal(0, turn, (knots - 1, 4))], axis=0)
    far = draw.draw(sampled_from([0.0, 6e6]))
    path = Trajectory(times, far + np.cumsum(rng.normal(0, 0.1, (knots, 3)), axis=0), rotation)
    span = int(times[-1] - times[0])
    offset = rng.integers(0, span + 1, count).astype(np.uint32)
    if count and draw.draw(booleans()):
        offset = np.sort(offset)
        offset[[0, -1]] = 0, span  # both ends of the trajectory
    ring = rng.integers(0, 32, count).astype(np.uint8)
    points = rng.normal(0, 30, (count, 3))
    points[rng.random(count) < 0.1] = 0.0
    names = ("range_offset_m", "elevation_offset_rad", "azimuth_offset_rad")
    corrections = {"range_offset_m": 0.02} | {f"channel_{name}": draw.draw(channel_offsets) for name in names}
    sweep = Burst(int(times[0]), points, ring, ring, offset)
    for given_corrections in (None, corrections):
        np.testing.assert_allclose(
            deskew_burst(sweep, RIG_FROM_LIDAR, path, given_corrections),
            deskew_plain(sweep, RIG_FROM_LIDAR, path, given_corrections),
            rtol=4e-16,
            atol=2e-12,
        )
