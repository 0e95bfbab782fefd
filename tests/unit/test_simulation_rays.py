"""Rays: a plane's ranges in closed form, movers against brute force at each ray's time, the spin."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from card.geometry import Trajectory, apply, inverse
from card.simulation.bodies import car, ego_body
from card.simulation.echoes import NOISE_M, REACH_M, RESOLUTION_M
from card.simulation.lidar import (
    CHANNEL_NS,
    PERIOD_NS,
    Lidar,
    burst_starts,
    columns,
    directions,
)
from card.simulation.mesh import Mesh, box, join, mesh
from card.simulation.raycast import Mover, Scene, Tracer
from card.simulation.rig import CHANNELS, LidarCorrections, nominal_rig
from card.simulation.scales import scale_named
from card.simulation.surfaces import Surface
from card.simulation.world import World, build_world

Array = NDArray[np.float64]
_FAR = 400.0


def plane(z: float) -> Mesh:
    corners = [[-_FAR, -_FAR, z], [_FAR, -_FAR, z], [_FAR, _FAR, z], [-_FAR, _FAR, z]]
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], Surface.ASPHALT)


def moving(body: Mesh, start: Array, velocity: Array, spin: float) -> Mover:
    t_ns = np.arange(0, 1_000_000_001, 40_000_000)
    t = t_ns[:, None] * 1e-9
    half = spin * t / 2
    quaternion = np.hstack([np.cos(half), 0 * t, 0 * t, np.sin(half)])
    return Mover(body, Trajectory(t_ns, start + velocity * t, quaternion))


def brute_force(triangles: Array, origin: Array, ray: Array) -> float:
    """Nearest range by Moeller and Trumbore, one ray against all triangles (T, 3, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(ray, c)
    scale = np.sum(b * p, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum((origin - a) * p, axis=1) / scale
        q = np.cross(origin - a, b)
        v = (q @ ray) / scale
        t = np.sum(c * q, axis=1) / scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return float(t[hit].min()) if hit.any() else np.inf


def test_movers_are_met_where_they_are_at_each_rays_own_time() -> None:
    static = join([plane(-1.7), box((-8, 14, -2), (8, 16, 3), Surface.FACADE)])
    movers = [
        moving(car((1, 1, 1), (0, 1)), np.array([-6.0, 9.0, -1.7]), np.array([12.0, 0.0, 0.0]), 1.0),
        moving(
            box((-0.3, -0.3, 0), (0.3, 0.3, 1.8), Surface.CLOTH), np.array([1.0, 5, -1.7]), np.zeros(3), 0.0
        ),
    ]
    tracer = Tracer(static, movers)
    rng = np.random.default_rng(2)
    t_ns = rng.integers(400_000_000, 500_000_000, 700)
    rays = directions(rng.uniform(-0.7, 0.7, 700), rng.uniform(-0.3, 0.15, 700))
    origins = rng.normal(0, 0.2, (700, 3))
    hits = tracer.cast(origins, rays, t_ns)
    met_mover = 0
    for k in range(700):
        parts = [static.vertices[static.triangles]]
        for mover in movers:
            corners = apply(mover.path.at(t_ns[k]), mover.mesh.vertices)
            parts.append(corners[mover.mesh.triangles])
        ranges = [brute_force(p, origins[k], rays[k]) for p in parts]
        assert hits.distance[k] == pytest.approx(min(ranges), abs=2e-3)
        moved = min(ranges[1:]) < ranges[0]
        assert (hits.triangle[k] >= tracer.static_triangles) == moved
        met_mover += moved
    assert met_mover > 60


def test_columns_cover_a_turn_in_whole_hundredths_of_a_degree() -> None:
    fired, azimuth = columns(250, 7)
    assert len(fired) == 250
    assert np.all(np.diff(azimuth) > 0)
    assert azimuth[-1] < 2 * np.pi
    hundredths = np.degrees(azimuth) * 100
    np.testing.assert_allclose(hundredths, np.round(hundredths), atol=1e-6)
    np.testing.assert_allclose(fired / PERIOD_NS, azimuth / (2 * np.pi), atol=1e-6)
    assert columns(250, 8)[1][0] != azimuth[0]


@pytest.fixture(scope="module")
def standing() -> World:
    """A car at rest on a plane, without anything else."""
    world = build_world("de_gravel_offroad", "tiny", 1)
    path = Trajectory(
        world.path.t_ns,
        np.zeros((len(world.path.t_ns), 3)),
        np.tile([1.0, 0, 0, 0], (len(world.path.t_ns), 1)),
    )
    offset = LidarCorrections(range_offset_m=0.02)
    rig = replace(nominal_rig(140, 140), lidar_corrections={"lidar_front": offset, "lidar_rear": offset})
    return replace(world, path=path, rig=rig, static=plane(-1.7), movers=[])


@pytest.mark.parametrize("name", ["lidar_front", "lidar_rear"])
def test_ranges_on_a_plane_in_closed_form(standing: World, name: str) -> None:
    lidar = Lidar(standing, Tracer(standing.static, []), Scene(ego_body()), name)
    errors = []
    for number, t_ns in enumerate(burst_starts(name, standing.start_ns, 6.0)[:12]):
        burst, truth = lidar.scan(t_ns, number)
        measured = np.linalg.norm(burst.points, axis=1)
        rays = burst.points / measured[:, None] @ standing.rig.rig_from[name][:3, :3].T
        wanted = -(1.7 + standing.rig.rig_from[name][2, 3]) / rays[:, 2]
        np.testing.assert_allclose(truth.range_m, wanted, rtol=1e-5, atol=1e-3)
        np.testing.assert_allclose(measured / RESOLUTION_M, np.round(measured / RESOLUTION_M), atol=1e-6)
        assert measured.max() < REACH_M
        assert not truth.dynamic.any()
        assert (truth.surface == Surface.ASPHALT).all()
        errors.append(measured - wanted)
        seconds = burst.offset_ns.astype(float) - 1512.0 * burst.ring
        azimuth = np.arctan2(burst.points[:, 0], burst.points[:, 1]) % (2 * np.pi)
        np.testing.assert_allclose(seconds / PERIOD_NS, azimuth / (2 * np.pi), atol=1e-7)
    error = np.concatenate(errors)
    assert error.mean() == pytest.approx(-0.02, abs=3e-4)  # 2 cm have to be added to what it says
    assert error.std() == pytest.approx(np.hypot(NOISE_M, RESOLUTION_M / np.sqrt(12)), rel=0.05)


def test_every_channel_fires_from_where_the_car_is_at_its_own_time() -> None:
    world = build_world("it_town_revisit", "tiny", 1)
    lidar = Lidar(world, Tracer(plane(-1.7), []), Scene(ego_body()), "lidar_rear")
    fired, _ = columns(90, 3)
    t_ns = world.start_ns + 2_000_000_000 + fired
    rays = np.random.default_rng(0).normal(size=(len(fired) * CHANNELS, 3))
    origins, turned = lidar._in_world(t_ns, np.array([0.0, -1.95, 0.16]), rays)
    pose = world.path.at(t_ns.repeat(CHANNELS) + np.tile(np.arange(CHANNELS), len(fired)) * CHANNEL_NS)
    np.testing.assert_allclose(turned, np.einsum("nij,nj->ni", pose[:, :3, :3], rays), atol=3e-7)
    np.testing.assert_allclose(origins, apply(pose, np.array([0.0, -1.95, 0.16])[None]), atol=3e-7)


def test_own_roof_hides_the_road_behind(standing: World) -> None:
    tracer = Tracer(standing.static, [])
    hidden = Lidar(standing, tracer, Scene(ego_body()), "lidar_front").scan(standing.start_ns, 0)[0]
    bare = Lidar(standing, tracer, Scene(box((90, 90, 90), (91, 91, 91), Surface.POLE)), "lidar_front")
    open_sky = bare.scan(standing.start_ns, 0)[0]
    assert len(hidden) < len(open_sky)
    rig = apply(standing.rig.rig_from["lidar_front"], hidden.points)
    ahead = np.count_nonzero(rig[:, 1] > 3)
    open_rig = apply(standing.rig.rig_from["lidar_front"], open_sky.points)
    assert ahead == np.count_nonzero(open_rig[:, 1] > 3)  # the hood is out of the front LiDAR's way


def test_rear_lidar_sees_the_road_behind(standing: World) -> None:
    lidar = Lidar(standing, Tracer(standing.static, []), Scene(ego_body()), "lidar_rear")
    points = apply(standing.rig.rig_from["lidar_rear"], lidar.scan(standing.start_ns, 0)[0].points)
    lane = points[np.abs(points[:, 0]) < 1.75]
    assert len(lane) > 20
    near = lane[np.linalg.norm(lane, axis=1) < 30]
    assert near[:, 1].max() < -2
    assert np.allclose(inverse(standing.rig.rig_from["lidar_rear"])[2, 2], np.cos(np.radians(15)))


@pytest.mark.parametrize("scale", ["tiny", "demo", "full"])
def test_a_revolution_ends_before_the_next_one_starts(scale: str) -> None:
    last_channel_ns = (CHANNELS - 1) * CHANNEL_NS
    ends = [columns(scale_named(scale).columns, number)[0][-1] + last_channel_ns for number in range(400)]
    assert max(ends) < PERIOD_NS
