"""Echoes against closed forms: steps, noise, dropouts, two returns; the errors of a unit found again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import Trajectory
from card.geometry.corrections import correct_points
from card.simulation.echoes import (
    BEAM,
    NOISE_M,
    REACH_M,
    RESOLUTION_M,
    detection_rate,
    echo_power,
    measured_range,
    returns_of,
)
from card.simulation.lidar import Lidar, burst_starts
from card.simulation.mesh import Mesh, box, join, mesh
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CHANNELS, LIDARS, LidarCorrections, built_rig, nominal_rig
from card.simulation.simulate import simulate_drive
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.world import World, build_world

Array = NDArray[np.float64]
_NOWHERE = Scene(box((90, 90, 90), (91, 91, 91), Surface.POLE))


def plane(z: float, surface: Surface) -> Mesh:
    corners = [[-400, -400, z], [400, -400, z], [400, 400, z], [-400, 400, z]]
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], surface)


@pytest.fixture(scope="module")
def standing() -> World:
    """The drawn car at rest, without a world."""
    world = build_world("de_gravel_offroad", "tiny", 1)
    count = len(world.path.t_ns)
    path = Trajectory(world.path.t_ns, np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1)))
    return replace(world, path=path, rig=nominal_rig(140, 140), movers=[])


def test_reported_ranges_are_noisy_and_whole_steps() -> None:
    true = np.random.default_rng(0).uniform(1, 100, 200_000)
    errors = LidarCorrections(0.003, np.linspace(-0.004, 0.004, CHANNELS))
    ring = np.arange(len(true)) % CHANNELS
    measured = measured_range(true, ring, errors, np.random.default_rng(1))
    np.testing.assert_allclose(measured / RESOLUTION_M, np.rint(measured / RESOLUTION_M), atol=1e-9)
    error = measured + 0.003 + errors.channel_range_offset_m[ring] - true
    assert abs(error.mean()) < 4 * NOISE_M / np.sqrt(len(true))
    assert error.std() == pytest.approx(np.hypot(NOISE_M, RESOLUTION_M / np.sqrt(12)), rel=0.01)


def test_as_many_echoes_come_back_as_the_data_sheet_says() -> None:
    def rate(reflectivity: float, distance: float, incidence: float = 0.0) -> float:
        cosine = np.cos(np.radians(incidence))
        return float(detection_rate(echo_power(np.float64(distance), np.float64(reflectivity), cosine)))

    assert rate(0.1, 80) > 0.85
    assert rate(0.5, 119) > 0.95
    assert rate(0.1, 20) > 0.99
    assert rate(0.12, 30, incidence=87) < rate(0.12, 30, incidence=80) < rate(0.12, 30)


@pytest.mark.parametrize("surface", [Surface.ASPHALT, Surface.GRASS])
def test_grazing_dark_and_far_ground_drops_out_by_the_model(standing: World, surface: Surface) -> None:
    world = replace(standing, static=plane(-1.7, surface))
    lidar = Lidar(world, Tracer(world.static, []), _NOWHERE, "lidar_front")
    rings = [
        lidar.scan(t_ns, number)[0].ring
        for number, t_ns in enumerate(burst_starts("lidar_front", world.start_ns, 6.0)[:40])
    ]
    found = np.bincount(np.concatenate(rings), minlength=CHANNELS) / (40 * world.scale.columns)
    # The front LiDAR leans ahead by 5 degrees, so each channel meets the plane at many ranges.
    azimuth = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    elevation = np.radians(15.0 - np.arange(CHANNELS))[:, None]
    tilt = np.radians(5.0)
    down = -np.sin(elevation) * np.cos(tilt) + np.cos(elevation) * np.cos(azimuth) * np.sin(tilt)
    with np.errstate(divide="ignore"):
        distance = np.where(down > 0, (1.7 + 0.14) / down, np.inf)
    power = echo_power(distance, np.float64(LOOKS[surface].reflectivity), np.maximum(down, 0))
    wanted = np.where(distance < REACH_M, detection_rate(power), 0).mean(axis=1)
    assert 0.05 < found.mean() < 0.6
    np.testing.assert_allclose(found, wanted, atol=4 * np.sqrt(0.25 / (40 * world.scale.columns)))


def test_an_edge_gives_two_returns_where_the_beam_meets_both(standing: World) -> None:
    # Its sides are where the second column to the right and to the left of ahead fires.
    half = 9.95 * np.tan(np.radians(0.36))
    pole = box((-half, 9.95, -1.7), (half, 10.05, 5), Surface.FACADE)
    wall = box((-60, 20, -3), (60, 20.5, 30), Surface.FACADE)
    world = replace(standing, static=join([pole, wall]), scale=replace(standing.scale, columns=2000))
    tracer = Tracer(world.static, [])
    single, dual = (
        Lidar(world, tracer, _NOWHERE, "lidar_front", dual=d).scan(world.start_ns, 0) for d in (False, True)
    )
    burst, truth = dual
    beam = burst.offset_ns.astype(np.int64) * CHANNELS + burst.ring
    assert np.all(np.diff(burst.offset_ns.astype(np.int64)) >= 0)
    twice = np.flatnonzero(np.diff(beam) == 0)
    assert 20 < len(twice) < 0.2 * len(burst)
    pairs = truth.range_m[np.stack([twice, twice + 1])]
    assert np.all((pairs.min(axis=0) < 15) & (pairs.max(axis=0) > 15))
    # Each beam within half its width of the pole's two sides, and no other, meets both.
    azimuth = np.arctan2(burst.points[twice, 0], burst.points[twice, 1])
    side = np.radians(0.36)
    assert np.all(np.abs(np.abs(azimuth) - side) < BEAM[:, 0].max() + 2e-4)
    assert len(np.unique(beam)) == pytest.approx(len(single[0]), rel=0.02)


def test_strongest_and_last_in_numbers() -> None:
    rng = np.random.default_rng(0)
    distance = np.array([[10.0, 10.0, np.inf], [10.1, 30.0, np.inf], [25.0, 30.0, 119.9]])
    power = np.array([[5e-4, 1e-3, 0], [5e-4, 4e-3, 0], [9e-4, 4e-3, 1e-12]])
    back = returns_of(distance, power, rng, dual=True)
    # Two rays of beam 0 hit one thing, which together shine brighter than the third.
    assert list(zip(back.beam, back.ray, strict=True)) == [(0, 0), (0, 2), (1, 1)]
    assert list(returns_of(distance, power, rng, dual=False).beam) == [0, 1]


def test_units_are_within_the_data_sheet_and_keep_their_channels(standing: World) -> None:
    builds = ("2026-04-14", 1), ("2026-05-19", 1), ("2026-04-14", 2)
    first, later, other = (built_rig(day, seed, 140, 140) for day, seed in builds)
    for name in LIDARS:
        errors = first.lidar_corrections[name]
        ranges = errors.range_offset_m + errors.channel_range_offset_m
        assert 0.001 < np.abs(ranges).max() <= 0.01
        for angles in (errors.channel_azimuth_offset_rad, errors.channel_elevation_offset_rad):
            assert np.radians(0.01) < angles.std() < np.radians(0.06)
            assert np.abs(angles).max() < np.radians(0.1)
        same, another = later.lidar_corrections[name], other.lidar_corrections[name]
        assert np.array_equal(errors.channel_range_offset_m, same.channel_range_offset_m)
        assert errors.range_offset_m != same.range_offset_m
        assert not np.array_equal(errors.channel_range_offset_m, another.channel_range_offset_m)
    assert np.array_equal(first.imu.gyro, later.imu.gyro)
    assert 1e-4 < np.abs(first.imu.gyro - np.eye(3)).max() < 5e-3


def test_corrections_put_every_channel_back_on_the_plane(standing: World) -> None:
    rig = replace(standing.rig, lidar_corrections=built_rig("2026-04-14", 3, 140, 140).lidar_corrections)
    world = replace(standing, static=plane(-1.7, Surface.SIDEWALK), rig=rig)
    lidar = Lidar(world, Tracer(world.static, []), _NOWHERE, "lidar_rear")
    bursts = [lidar.scan(t, k)[0] for k, t in enumerate(burst_starts("lidar_rear", world.start_ns, 6.0)[:50])]
    points, ring = (np.concatenate([getattr(b, name) for b in bursts]) for name in ("points", "ring"))
    errors = rig.lidar_corrections["lidar_rear"]
    corrections = {name: getattr(errors, name) for name in LidarCorrections.__dataclass_fields__}
    pose = rig.rig_from["lidar_rear"]
    raw_off, off = [], []
    for channel in np.unique(ring):
        near = (ring == channel) & (np.linalg.norm(points, axis=1) < 12)
        if near.sum() < 800:
            continue
        whole = correct_points(points[near], ring[near], corrections)
        for found, these in ((raw_off, points[near]), (off, whole)):
            rays = these / np.linalg.norm(these, axis=1, keepdims=True) @ pose[:3, :3].T
            found.append(np.mean((these @ pose[:3, :3].T + pose[:3, 3])[:, 2] + 1.7) / -rays[:, 2].mean())
    assert len(off) > 8
    assert np.abs(off).max() < 4 * 0.0051 / np.sqrt(800)
    assert np.abs(raw_off).max() > 5 * np.abs(off).max()


def test_a_bag_of_dual_returns_is_refused(tmp_path: Path) -> None:
    folders = {"recording": tmp_path / "r", "truth": tmp_path / "t"}
    with pytest.raises(CardError, match="single returns"):
        simulate_drive("de_gravel_offroad", **folders, scale="tiny", seed=1, dual_returns=True)
    assert list(tmp_path.iterdir()) == []
