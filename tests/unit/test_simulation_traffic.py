"""Others on the road: how they move, that they keep out of each other's way, what stands beside them."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from card.geometry import inverse
from card.simulation.bodies import CAR_LENGTH_M, CAR_TRACK_M, CAR_WHEELBASE_M, CAR_WIDTH_M
from card.simulation.car_following import Barrier, flow
from card.simulation.mesh import join
from card.simulation.raycast import Scene
from card.simulation.scenery import trees
from card.simulation.surfaces import Surface
from card.simulation.walking import (
    ARM_SWING,
    LEG_SWING,
    STRIDE_M,
    WALK_M_S,
    aside,
    crossing,
    strolling,
    swing,
)
from card.simulation.world import World, build_world

Array = NDArray[np.float64]
STEP_S = 0.04
TIME = np.arange(0.0, 40.0, STEP_S)


def test_cars_in_a_row_find_the_gap_of_the_model_s_equilibrium() -> None:
    speed, desired = 7.0, 9.0
    leader = 100.0 + speed * TIME
    place = flow(TIME, np.array([60.0, 40.0]), speed, desired, CAR_LENGTH_M, ahead=leader)
    # s_e(v) = (s0 + v T) / sqrt(1 - (v / v0)^4)
    wanted = (2.0 + speed * 1.2) / np.sqrt(1 - (speed / desired) ** 4)
    gap = leader[-1] - place[-1, 0] - CAR_LENGTH_M / 2
    assert gap == pytest.approx(wanted, rel=0.02)
    assert (place[:, 0] - place[:, 1] > CAR_LENGTH_M).all()


def test_cars_wait_at_a_barrier_and_go_on() -> None:
    barrier = Barrier(50.0, 0.0, 20.0)
    place = flow(TIME, np.array([0.0, -15.0]), 8.0, 8.0, CAR_LENGTH_M, barrier=barrier)
    front = place[:, 0] + CAR_LENGTH_M / 2
    assert front[TIME <= 20].max() < 50.0
    assert front[np.searchsorted(TIME, 19.9)] == pytest.approx(48.0, abs=1.0)  # 2 m short of it
    assert front[-1] > 100.0
    assert np.gradient(place[:, 0], STEP_S).min() > -1e-9
    assert np.gradient(np.gradient(place[:, 0], STEP_S), STEP_S)[2:-2].min() > -8.5


def test_cars_on_a_ring_stay_apart() -> None:
    start = -np.arange(6) * 30.0
    place = flow(TIME, start, 7.0, 9.0, CAR_LENGTH_M, ring=200.0, barrier=Barrier(20.0, 5.0, 15.0))
    gaps = np.concatenate([place[:, -1:] + 200.0 - place[:, :1], place[:, :-1] - place[:, 1:]], axis=1)
    assert gaps.min() > CAR_LENGTH_M + 0.5


def test_walkers_walk_at_their_pace_and_cross_when_and_where_they_should() -> None:
    way = crossing(TIME, 30.0, 1.75, 5.0, 20.0, 1, -1)
    middle = np.argmin(abs(TIME - 20.0))
    assert (way.s[middle], way.d[middle]) == pytest.approx((30.0, 1.75), abs=1e-6)
    assert way.turn[middle] == pytest.approx(-np.pi / 2)  # to the right of the road
    assert way.d.min() == pytest.approx(-5.0)
    assert way.d.max() == pytest.approx(5.0)
    speed = np.hypot(np.gradient(way.s, STEP_S), np.gradient(way.d, STEP_S))
    assert speed.max() < WALK_M_S + 1e-6
    assert np.mean(speed > 0.99 * WALK_M_S) > 0.85  # slower only around corners
    # They face where they go.
    ahead = np.stack([np.cos(way.turn), -np.sin(way.turn)], axis=1)
    gone = np.stack([np.gradient(way.s), np.gradient(way.d)], axis=1)
    along = np.sum(ahead * gone, axis=1) / np.linalg.norm(gone, axis=1)
    assert along[2:-2].min() > 0.9


def test_walkers_step_aside_for_what_is_parked() -> None:
    def offset(s: Array) -> Array:
        return aside(s, [20.0, 50.0], CAR_LENGTH_M / 2, 4.5, 5.5)

    way = strolling(TIME, 0.0, 0.0, False, offset)
    beside = np.minimum(abs(way.s - 20.0), abs(way.s - 50.0)) < CAR_LENGTH_M / 2 - 0.6
    assert way.d[beside].min() > 5.4
    assert way.d[abs(way.s - 35.0) < 5].max() == pytest.approx(4.5)


def test_limbs_swing_with_the_way_gone_and_hang_when_standing() -> None:
    way = strolling(TIME, 0.0, 20.0, True, np.zeros_like)
    angle = swing(way, STEP_S, LEG_SWING, 0.3)
    wanted = LEG_SWING * np.sin(2 * np.pi * WALK_M_S * (TIME - 20.0) / STRIDE_M + 0.3)
    np.testing.assert_allclose(angle, wanted, atol=1e-9)
    way.gone[500:] = way.gone[500]
    assert np.abs(swing(way, STEP_S, LEG_SWING, 0.3)[502:]).max() == 0.0


@pytest.fixture(scope="module", params=["it_zero_shot", "it_town_revisit"])
def busy(request: pytest.FixtureRequest) -> World:
    return build_world(request.param, "demo", 3)


def _standing_times(world: World) -> NDArray[np.int64]:
    t_ns = world.movers[0].path.t_ns
    return t_ns[(t_ns > world.start_ns) & (t_ns < world.start_ns + round(world.scale.duration_s * 1e9))][::5]


Footprints = list[tuple[Array, Array, tuple[float, float], NDArray[np.bool_]]]


def _footprints(world: World, indices: tuple[int, ...], half: tuple[float, float]) -> Footprints:
    """Middles (N, 2), directions (N, 2) and half sizes over time, and when each is on the road."""
    found = []
    for index in indices:
        pose = world.movers[index].path.at(_standing_times(world))
        ground = world.road.land(pose[:, :2, 3])
        found.append((pose[:, :2, 3], pose[:, :2, 1], half, abs(pose[:, 2, 3] - ground) < 5))
    return found


def _overlap(one, other) -> bool:  # type: ignore[no-untyped-def]
    """Whether two rectangles ever overlap (separating axes)."""
    (ca, fa, ha, here_a), (cb, fb, hb, here_b) = one, other
    apart = ~(here_a & here_b)
    turned = [np.stack([f[:, 1], -f[:, 0]], axis=1) for f in (fa, fb)]
    for axis in (fa, fb, *turned):
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        reach = sum(
            half * np.abs(np.sum(side * axis, axis=1))
            for half, side in ((ha[0], turned[0]), (ha[1], fa), (hb[0], turned[1]), (hb[1], fb))
        )
        apart |= np.abs(np.sum((ca - cb) * axis, axis=1)) > reach
    return not apart.all()


def test_nobody_drives_into_anybody(busy: World) -> None:
    cars = _footprints(busy, busy.cars, (CAR_WIDTH_M / 2, CAR_LENGTH_M / 2))
    walkers = _footprints(busy, busy.walkers, (0.2, 0.2))
    own = busy.path.at(_standing_times(busy))
    middle = own[:, :2, 3] - 0.65 * own[:, :2, 1]
    ours = (middle, own[:, :2, 1], (0.94, 2.31), np.ones(len(own), dtype=bool))
    assert len(cars) >= 2
    for index, car in enumerate(cars):
        assert not any(_overlap(car, other) for other in [*cars[:index], *walkers, ours])
    assert not any(_overlap(walker, ours) for walker in walkers)


def test_walkers_do_not_walk_through_what_stands(busy: World) -> None:
    solid = np.isin(
        busy.static.surface,
        (Surface.CAR_BODY, Surface.CAR_GLASS, Surface.POLE, Surface.TRUNK, Surface.FACADE, Surface.TYRE),
    )
    corners = np.unique(busy.static.triangles[solid])
    solid_at = cKDTree(busy.static.vertices[corners][:, :2])
    for path, _, _, here in _footprints(busy, busy.walkers, (0.2, 0.2)):
        gap, _ = solid_at.query(path[here])
        assert gap.min() > 0.2


def test_there_is_a_car_behind_and_one_ahead_in_our_lane(busy: World) -> None:
    world = busy
    times = _standing_times(world)
    from_world = inverse(world.path.at(times))
    ahead = behind = 0
    for index in world.cars:
        seen = np.einsum("nij,nj->ni", from_world, world.movers[index].path.at(times)[:, :, 3])
        lane = (np.abs(seen[:, 0]) < 1.0) & (np.abs(seen[:, 1]) < 60)
        ahead += np.mean(lane & (seen[:, 1] > 3)) > 0.5
        behind += np.mean(lane & (seen[:, 1] < -4)) > 0.5
    assert (ahead, behind) == (world.drive.leader, world.drive.follower)


def test_moving_cars_have_their_wheels_on_the_road(busy: World) -> None:
    times = _standing_times(busy)
    for index in busy.cars[:3]:
        pose = busy.movers[index].path.at(times)
        here = abs(pose[:, 2, 3] - busy.road.land(pose[:, :2, 3])) < 5
        guess = _nearest_s(busy, pose[here, :2, 3])
        for axle in (-CAR_WHEELBASE_M / 2, CAR_WHEELBASE_M / 2):
            feet = [pose[here] @ [side, axle, 0.0, 1.0] for side in (-CAR_TRACK_M / 2, CAR_TRACK_M / 2)]
            gap = [foot[:, 2] - busy.road.height(foot[:, :2], guess) for foot in feet]
            assert np.quantile(np.abs(np.mean(gap, axis=0)), 0.95) < 0.03


def test_parked_cars_stand_on_road_and_kerb(busy: World) -> None:
    mesh = busy.static
    tyres = np.unique(mesh.triangles[mesh.surface == Surface.TYRE])
    wheels = mesh.vertices[tyres].reshape(-1, 44, 3)  # four rings of eleven each
    assert len(wheels) >= 8
    lowest = wheels[np.arange(len(wheels)), wheels[..., 2].argmin(axis=1)]
    middle = wheels.mean(axis=1)
    gap = lowest[:, 2] - busy.road.height(middle[:, :2], _nearest_s(busy, middle[:, :2]))
    assert np.abs(gap).max() < 0.06


def _nearest_s(world: World, xy: Array) -> Array:
    line = world.road.line
    s = np.arange(line.start, line.start + line.length, 0.5)
    return np.asarray(s[cKDTree(world.road.bare(s, 0 * s)[:, :2]).query(xy)[1]])


def test_limbs_stay_on_their_joints_and_within_their_swing(busy: World) -> None:
    times = _standing_times(busy)
    for trunk in busy.walkers[:4]:
        body = inverse(busy.movers[trunk].path.at(times))
        limbs = [body @ busy.movers[trunk + k].path.at(times) for k in range(1, 5)]
        for limb, (widest, highest) in zip(limbs, [(LEG_SWING, 1.0), (ARM_SWING, 1.55)] * 2, strict=True):
            # Chords of a path that turns are a little shorter than the path.
            assert np.ptp(limb[:, :3, 3], axis=0).max() < 0.02
            assert 0.8 < limb[0, 2, 3] < highest
            angle = np.arctan2(limb[:, 2, 1], limb[:, 1, 1])
            assert np.abs(angle).max() < widest + 1e-6
            assert np.ptp(angle) > widest
        left_leg, left_arm, right_leg, _ = (np.arctan2(m[:, 2, 1], m[:, 1, 1]) for m in limbs)
        assert np.corrcoef(left_leg, right_leg)[0, 1] < -0.9
        assert np.corrcoef(left_leg, left_arm)[0, 1] < -0.9


def test_rays_pass_through_trees_in_part(busy: World) -> None:
    rng = np.random.default_rng(4)
    plants = trees(busy.road, [(s, 20.0) for s in (10.0, 20.0, 30.0)], rng, street=False)
    for plant in plants:
        leaves = plant.vertices[plant.triangles[plant.surface == Surface.FOLIAGE]].mean(axis=1)
        middle, radius = (
            leaves.mean(axis=0),
            np.quantile(np.linalg.norm(leaves - leaves.mean(0), axis=1), 0.5),
        )
        offset = rng.uniform(-0.7, 0.7, (2000, 3)) * radius * [1, 0, 1]
        hits = Scene(join([plant])).cast(middle + offset - [0, 15, 0], np.array([0.0, 1.0, 0.0]))
        met = hits.triangle >= 0
        assert 0.2 < met.mean() < 0.95
        depth = hits.distance[met]
        assert np.ptp(np.quantile(depth, [0.1, 0.9])) > 0.3 * radius  # not a shell
