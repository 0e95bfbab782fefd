"""Contact paths, arc length and height of points, and the excitation read off them."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.artifacts import default_settings
from card.geometry import Trajectory
from card.wheels import arc_height
from card.wheels.arc_height import Corridor, RoadPoints, project
from card.wheels.contact_path import ContactPath, contact_path
from card.wheels.profile import SplineSettings
from card.wheels.wheel_fit import Excitation, QualitySettings, fit_excitation

Array = NDArray[np.float64]
CONTACT = np.array([-0.8, 1.0, -1.7])
STEP_M = 0.05


def trajectory(along: Array, *, heave: Array | float = 0.0, euler_zxy: Array | None = None) -> Trajectory:
    """A drive along world y at 100 Hz with `along` (N,) metres, and heave and attitude if any."""
    n = len(along)
    position = np.stack([np.zeros(n), along, np.full(n, 1.7) + heave], axis=1)
    angles = np.zeros((n, 3)) if euler_zxy is None else euler_zxy
    quaternion = Rotation.from_euler("ZXY", angles).as_quat()[:, [3, 0, 1, 2]]
    return Trajectory(1_776_153_600_000_000_000 + np.arange(n) * 10_000_000, position, quaternion)


def swaying() -> ContactPath:
    n = 800
    t = np.arange(n) / 100
    euler = np.stack([0.15 * t, 0.02 * np.sin(2 * t), 0.03 * np.sin(1.5 * t)], axis=1)
    return contact_path(trajectory(6 * t, heave=0.03 * np.sin(5 * t), euler_zxy=euler), CONTACT, STEP_M)


def fit(path: ContactPath, road: RoadPoints, **changes: float) -> Excitation:
    """The excitation with the default settings but for some changes."""
    defaults = default_settings("wheels") | changes
    spline = SplineSettings(**{name: defaults[name] for name in SplineSettings.__dataclass_fields__})
    quality = QualitySettings(**{name: defaults[name] for name in QualitySettings.__dataclass_fields__})
    return fit_excitation(path, road, spline, quality, defaults["footprint_m"])


def corridor_points(
    points: Array, path: ContactPath, window: tuple[float, float], sides: Corridor
) -> RoadPoints:
    """The corridor's points, found both ways."""
    fast, which = arc_height.corridor_points(points, path, window, sides)
    plain, same = arc_height.corridor_points(points, path, window, sides, compiled=False)
    np.testing.assert_array_equal(which, same)
    for name in RoadPoints.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(fast, name), getattr(plain, name))
    return fast


def level(arc: Array, height: float) -> RoadPoints:
    """Points of one height at arc lengths (Q,), spread over the corridor."""
    sideways = 0.1 * np.sin(7.0 * np.arange(len(arc)))
    return RoadPoints(arc, sideways, np.full(len(arc), height), np.zeros(len(arc), dtype=np.int64))


def test_arc_length_and_height_follow_the_paper() -> None:
    path = swaying()
    rng = np.random.default_rng(0)
    position, rotation, arc = path.knot_position, path.knot_rotation, path.knot_arc
    points = position[rng.integers(3, len(position) - 3, 200)] + rng.normal(0, 0.1, (200, 3))
    d, h, sideways = project(points, position, rotation, arc)
    for n, p in enumerate(points):
        distance = [float(np.linalg.norm(p - t)) for t in position]
        # The two closest adjacent poses: the nearest and the nearer of its neighbours.
        k = int(np.argmin(distance))
        i = k if distance[k - 1] < distance[k + 1] else k + 1
        step = position[i] - position[i - 1]
        length = np.linalg.norm(step)
        alpha = float(np.dot(step / length, p - position[i - 1]) / length)
        local = [rotation[j].T @ (p - position[j]) for j in (i - 1, i)]
        assert d[n] == pytest.approx((1 - alpha) * arc[i - 1] + alpha * arc[i], abs=1e-12)
        assert h[n] == pytest.approx((1 - alpha) * local[0][2] + alpha * local[1][2], abs=1e-12)
        assert sideways[n] == pytest.approx((1 - alpha) * local[0][0] + alpha * local[1][0], abs=1e-12)


def test_surface_undoes_the_projection() -> None:
    path = swaying()
    arc = np.random.default_rng(1).uniform(1, path.knot_arc[-1] - 1, 300)
    height = np.random.default_rng(2).uniform(-0.1, 0.1, 300)
    points = path.surface(arc, height)
    d, h, _ = project(points, path.knot_position, path.knot_rotation, path.knot_arc)
    # Up is not quite square to the path: off the path d shifts by that slope, and h by slope times shift.
    slope = 0.06
    assert np.abs(d - arc).max() < slope * np.abs(height).max()
    assert np.abs(h - height).max() < slope * np.abs(d - arc).max()
    d, h, _ = project(path.surface(arc, 0 * arc), path.knot_position, path.knot_rotation, path.knot_arc)
    np.testing.assert_allclose(d, arc, atol=1e-9)
    np.testing.assert_allclose(h, 0, atol=1e-4)


def test_standing_adds_no_arc_length() -> None:
    drive = np.concatenate(
        [np.linspace(0, 10, 200), 10 + 0.004 * np.sin(np.arange(300)), np.linspace(10, 20, 200)]
    )
    path = contact_path(trajectory(drive), CONTACT, STEP_M)
    assert path.knot_arc[-1] == pytest.approx(20, abs=0.06)
    assert np.diff(path.knot_arc).min() >= STEP_M
    assert np.ptp(path.arc[205:495]) < 0.01
    assert set(path.run) == {0}


@pytest.mark.parametrize("seed", range(3))
def test_knots_are_a_step_apart(seed: int) -> None:
    """Against the plain loop, for a car that creeps, stands and drives, and ends in the middle of a step."""
    rng = np.random.default_rng(seed)
    along = np.cumsum(
        np.repeat(rng.uniform(0, 0.08, 40) * (rng.uniform(size=40) > 0.3), rng.integers(1, 30, 40))
    )
    path = contact_path(trajectory(along, heave=0.01 * np.sin(np.arange(len(along)))), CONTACT, STEP_M)
    wanted = [0]
    for i, point in enumerate(path.position):
        if np.linalg.norm(point - path.position[wanted[-1]]) >= STEP_M:
            wanted.append(i)
    last = len(along) - 1
    if np.linalg.norm(path.position[last] - path.position[wanted[-2]]) >= STEP_M:
        wanted[-1] = last
    assert 30 < len(wanted) < len(along)
    np.testing.assert_array_equal(path.knots, wanted)


def test_a_car_that_never_moves_has_a_path() -> None:
    path = contact_path(trajectory(np.zeros(50)), CONTACT, STEP_M)
    excitation = fit(path, RoadPoints.joined([]))
    np.testing.assert_allclose(excitation.position, np.tile([-0.8, 1.0, 0.0], (50, 1)), atol=1e-12)
    assert excitation.gap.all()
    assert excitation.uncertain.all()


def test_reverse_starts_a_run_and_takes_the_points_again() -> None:
    drive = np.concatenate([np.linspace(0, 10, 200), np.linspace(10, 4, 120)[1:]])
    path = contact_path(trajectory(drive), CONTACT, STEP_M)
    assert path.knot_arc[-1] == pytest.approx(16, abs=0.1)
    assert sorted(set(path.run)) == [0, 1]
    points = np.array([[-0.8, 1.0 + 7.0, 0.02]])
    road = corridor_points(points, path, (-100.0, 100.0), Corridor(0.12, 0.35))
    np.testing.assert_allclose(np.sort(road.arc), [7, 13], atol=0.06)
    np.testing.assert_allclose(road.height, 0.02, atol=1e-9)


def test_a_second_pass_keeps_its_own_points() -> None:
    """Around a block and back on the same street: a window takes a point only on its own pass."""
    angle = np.linspace(0, 4 * np.pi, 4000)
    radius = 30.0
    n = len(angle)
    position = np.stack([radius * (np.cos(angle) - 1), radius * np.sin(angle), np.full(n, 1.7)], axis=1)
    position[:, 2] += 0.05 * (angle > 2 * np.pi)  # the second lap drifted up
    quaternion = Rotation.from_rotvec(np.outer(angle, [0, 0, 1])).as_quat()[:, [3, 0, 1, 2]]
    path = contact_path(Trajectory(np.arange(n) * 10_000_000, position, quaternion), CONTACT, STEP_M)
    lap = path.knot_arc[-1] / 2
    k = int(np.searchsorted(path.knot_arc, lap * 1.25))
    point = path.knot_position[k : k + 1]
    second = corridor_points(point, path, (1.1 * lap, 1.4 * lap), Corridor(0.12, 0.35))
    np.testing.assert_allclose(second.arc, [path.knot_arc[k]], atol=1e-9)
    np.testing.assert_allclose(second.height, [0], atol=1e-9)
    first = corridor_points(point, path, (0.1 * lap, 0.4 * lap), Corridor(0.12, 0.35))
    np.testing.assert_allclose(first.height, [0.05], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_compiled_and_plain_corridors_are_the_same(seed: int) -> None:
    """Forward, back and forward over a swaying path, in windows that cut it anywhere."""
    rng = np.random.default_rng(seed)
    y = np.concatenate([np.linspace(0, 12, 200), np.linspace(12, 5, 150), np.linspace(5, 15, 180)])
    t = np.arange(len(y)) / 100
    euler = np.stack([0.1 * np.sin(t), 0.02 * np.sin(2 * t), 0.03 * np.sin(1.5 * t)], axis=1)
    path = contact_path(trajectory(y, heave=0.02 * np.sin(5 * t), euler_zxy=euler), CONTACT, STEP_M)
    points = path.position[rng.integers(0, len(y), 3000)] + rng.normal(0, [0.15, 0.3, 0.25], (3000, 3))
    first = rng.uniform(-2, 20)
    found = corridor_points(points, path, (first, first + rng.uniform(1, 15)), Corridor(0.12, 0.35, 0.17))
    assert 100 < len(found) < 8000


def test_a_run_that_ends_still_has_its_footprint() -> None:
    """A car drives up a slope of 10 %, stands and goes back: at the turn nothing is missing."""
    along = np.concatenate([np.linspace(0, 10, 200), np.full(50, 10.0), np.linspace(10, 2, 160)])
    path = contact_path(trajectory(along, heave=0.1 * along), CONTACT, STEP_M)
    y = np.linspace(0, 13, 6000)
    points = np.stack([-0.8 + 0.1 * np.sin(7.0 * np.arange(y.size)), y, 0.1 * (y - 1) + 0.01], axis=1)
    found = fit(path, corridor_points(points, path, (-1, 30), Corridor(0.12, 0.35, 0.17)))
    assert found.measured.all()
    np.testing.assert_allclose(found.position[:, 2] - 0.1 * (found.position[:, 1] - 1), 0.01, atol=1e-4)


def test_the_corridor_has_walls_and_ends() -> None:
    path = contact_path(trajectory(np.linspace(0, 10, 200)), CONTACT, STEP_M)
    base = np.array([-0.8, 6.0, 0.0])
    inside = [[0.119, 0, 0], [-0.119, 0, 0], [0, 0, 0.349], [0, 0, -0.349]]
    outside = [[0.121, 0, 0], [-0.121, 0, 0], [0, 0, 0.351], [0, -5.2, 0], [0, 5.2, 0]]
    corridor = Corridor(0.12, 0.35)
    assert len(corridor_points(base + np.array(inside), path, (0, 20), corridor)) == 4
    assert len(corridor_points(base + np.array(outside), path, (0, 20), corridor)) == 0
    assert len(corridor_points(base + np.array(inside), path, (5.2, 20), corridor)) == 0


def road(y: Array) -> Array:
    """A bump 6 cm high and 3 m long at y = 15 m on a flat road."""
    return np.where(np.abs(y - 15) < 1.5, 0.03 * (1 + np.cos(np.pi * (y - 15) / 1.5)), 0.0)


def test_a_bump_under_a_swaying_body_is_recovered() -> None:
    t = np.arange(600) / 100
    sway = 0.02 * np.sin(4 * t)
    euler = np.stack([0 * t, 0.01 * np.sin(3 * t), 0.01 * np.sin(2 * t)], axis=1)
    path = contact_path(trajectory(5 * t, heave=sway, euler_zxy=euler), CONTACT, STEP_M)
    rng = np.random.default_rng(5)
    y = rng.uniform(0, 31, 6000)
    points = np.stack([-0.8 + rng.uniform(-0.15, 0.15, y.size), y, road(y)], axis=1)
    found = fit(path, corridor_points(points, path, (-1, 100), Corridor(0.12, 0.35)))
    inner = slice(20, -20)
    error = found.position[inner, 2] - road(found.position[inner, 1])
    assert np.abs(error).max() < 1e-3
    assert not found.gap[inner].any()
    assert np.nanmax(found.residual_m[inner]) < 2e-3


def test_a_gap_is_flagged_and_the_rest_is_not() -> None:
    path = contact_path(trajectory(np.linspace(0, 30, 600)), CONTACT, STEP_M)
    arc = np.concatenate([np.linspace(2, 10, 400), np.linspace(14, 28, 700)])
    found = fit(path, level(arc, 0.03))
    gap = ((path.arc > 10.2) & (path.arc < 13.8)) | (path.arc < 1.8) | (path.arc > 28.2)
    near = np.abs(np.subtract.outer(path.arc, [1.8, 10.2, 13.8, 28.2])).min(axis=1) < 0.05
    np.testing.assert_array_equal(found.gap[~near], gap[~near])
    assert np.isnan(found.residual_m[path.arc < 1.5]).all()
    # Beyond the data the last height holds.
    np.testing.assert_allclose(found.position[path.arc > 28.2, 2], 0.03, atol=1e-6)


def test_a_dive_while_standing_leaves_the_road_where_it_is() -> None:
    along = np.concatenate([np.linspace(0, 10, 200), np.full(200, 10.0)])
    dive = np.concatenate([np.zeros(200), 0.02 * np.sin(np.arange(200) / 10)])
    path = contact_path(trajectory(along, heave=dive), CONTACT, STEP_M)
    y = np.linspace(1, 11, 1000)
    points = np.stack([np.full_like(y, -0.8), y, np.full_like(y, 0.01)], axis=1)
    found = fit(path, corridor_points(points, path, (-1, 20), Corridor(0.12, 0.35)))
    np.testing.assert_allclose(found.position[10:, 2], 0.01, atol=1e-5)


def test_contacts_between_samples_are_interpolated() -> None:
    path = contact_path(trajectory(np.linspace(0, 10, 200)), CONTACT, STEP_M)
    arc = np.linspace(0, 10, 1000)
    found = fit(path, level(arc, 0.0))
    position, std = found.at(path.t_ns[[40, 80]] + 5_000_000)
    np.testing.assert_allclose(
        position, (found.position[[40, 80]] + found.position[[41, 81]]) / 2, atol=1e-12
    )
    np.testing.assert_allclose(std, found.std_m[[40, 80]], rtol=0.2)


def test_a_hole_that_few_beams_reach_is_uncertain() -> None:
    """A hole 0.4 m long and 6 cm deep of which the far wall shows and the floor does not."""
    path = contact_path(trajectory(np.linspace(0, 30, 600)), CONTACT, STEP_M)
    arc = np.linspace(1, 29, 5000)
    over = level(arc[(arc < 14) | (arc > 14.4)], 0.0)
    wall = level(np.array([14.37, 14.38, 14.39]), -0.03)
    found = fit(path, RoadPoints.joined([over, wall]))
    inside = (path.arc > 14.02) & (path.arc < 14.38)
    assert found.uncertain[inside].all()
    assert found.measured[(path.arc > 2) & (path.arc < 13.7)].all()
    assert found.measured[(path.arc > 14.7) & (path.arc < 28)].all()


def test_a_tyre_half_over_an_edge_stands_on_the_mean() -> None:
    """A hole 6 cm deep under the right half of the corridor: the footprint's mean is 3 cm down."""
    path = contact_path(trajectory(np.linspace(0, 30, 600)), CONTACT, STEP_M)
    rng = np.random.default_rng(6)
    arc = rng.uniform(1, 29, 12000)
    sideways = rng.uniform(-0.12, 0.12, arc.size)
    hole = (np.abs(arc - 15) < 1) & (sideways > 0)
    height = np.where(hole, -0.06, 0.0) + rng.normal(0, 0.002, arc.size)
    road = RoadPoints(arc, sideways, height, np.zeros(arc.size, dtype=np.int64))
    found = fit(path, road)
    np.testing.assert_allclose(found.position[np.abs(path.arc - 15) < 0.7, 2], -0.03, atol=5e-3)
    np.testing.assert_allclose(found.position[np.abs(path.arc - 15) > 1.5, 2][30:-30], 0, atol=1e-3)
    # A spline that may not tilt takes one of the two levels.
    stiff = fit(path, road, tilt_penalty=1e9)
    assert np.abs(stiff.position[np.abs(path.arc - 15) < 0.7, 2] + 0.03).max() > 0.015


def test_a_sharp_turn_keeps_its_road() -> None:
    """A quarter circle of 4 m radius: the inner wheel's is 3.2 m, and a bump lies across its middle."""
    angle = np.linspace(0, np.pi / 2, 500)
    outer = contact_path(turn(angle), [0.8, 0.0, -1.7], STEP_M)
    inner = contact_path(turn(angle), [-0.8, 0.0, -1.7], STEP_M)
    assert outer.knot_arc[-1] / inner.knot_arc[-1] == pytest.approx(4.8 / 3.2, rel=2e-3)
    rng = np.random.default_rng(7)
    where, radius = rng.uniform(0, np.pi / 2, 30000), rng.uniform(2.8, 5.2, 30000)

    def bump(angle: Array) -> Array:
        return 0.04 * np.exp(-(((angle - np.pi / 4) / 0.15) ** 2))

    points = np.stack([radius * np.cos(where) - 4, radius * np.sin(where), bump(where)], axis=1)
    for path in (inner, outer):
        found = fit(path, corridor_points(points, path, (-1, 20), Corridor(0.12, 0.35)))
        inner_part = slice(40, -40)
        assert found.measured[inner_part].all()
        at = np.arctan2(found.position[inner_part, 1], found.position[inner_part, 0] + 4)
        np.testing.assert_allclose(found.position[inner_part, 2], bump(at), atol=1.5e-3)


def turn(angle: Array) -> Trajectory:
    """Left around (-4, 0) by the angles (N,)."""
    n = len(angle)
    position = np.stack([4 * np.cos(angle) - 4, 4 * np.sin(angle), np.full(n, 1.7)], axis=1)
    quaternion = Rotation.from_rotvec(np.outer(angle, [0, 0, 1])).as_quat()[:, [3, 0, 1, 2]]
    return Trajectory(np.arange(n) * 10_000_000, position, quaternion)
