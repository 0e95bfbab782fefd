import numpy as np
import pytest
from ground_truth_clouds import small, street
from hypothesis import given, settings
from hypothesis import strategies as st

from card.errors import CardError
from card.ground_truth.hpr import visible
from card.ground_truth.hpr.visible import visible_points
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.reference.hidden_points import spans_space, visible_by_hull
from card.ground_truth.selection import diagonal

KINDS = ("uniform", "ties", "duplicates", "plane", "tiny", "far", "ground", "one ray", "sphere")


def places(points: np.ndarray, index: np.ndarray) -> set[tuple[float, ...]]:
    """Where the points are: of exact duplicates one must be returned, no matter which."""
    found = set(map(tuple, points[index].tolist()))
    assert len(found) == len(index)
    return found


def radius_of(points: np.ndarray, factor: float) -> float:
    """A radius as the stage takes it, but never so small that the cloud lies beyond it."""
    return factor * max(diagonal(points), np.linalg.norm(points, axis=1).max() / 40)


def agree(points: np.ndarray, radius: float) -> bool:
    fast, plain = visible_points(points, radius), visible_by_hull(points, radius)
    assert (np.diff(fast) > 0).all()
    return places(points, fast) == places(points, plain)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("factor", [100, 210])
def test_small_clouds_equal_the_hull(kind, factor):
    for seed in range(40):
        points = small(kind, seed)
        assert agree(points, radius_of(points, factor)), seed


coordinate = st.one_of(st.integers(-6, 6).map(float), st.floats(-6, 6, width=16))
point = st.tuples(
    coordinate, coordinate, st.one_of(st.integers(1, 8).map(float), st.floats(0.5, 8, width=16))
)


@settings(max_examples=150, deadline=None)
@given(st.lists(point, min_size=1, max_size=60), st.sampled_from([3, 100, 210]))
def test_any_scene_equals_the_hull(scene, factor):
    points = np.array(scene)
    radius = radius_of(points, max(factor, 41))
    if spans_space(points):
        assert agree(points, radius)
    else:
        assert visible_points(points, radius).tolist() == list(range(len(points)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("factor", [100, 210])
def test_a_street_equals_the_hull(seed, factor):
    points = street(40_000, seed)
    assert agree(points, factor * diagonal(points))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "factor"), [(0, 100), (1, 210)])
def test_a_street_of_real_size_equals_the_hull(seed, factor):
    points = street(4_000_000, seed)
    assert agree(points, factor * diagonal(points))


def test_a_margin_of_a_tenth_radian_makes_the_crop_exact():
    whole = street(150_000, 5, half_width=2.5, half_height=1.5)
    R = 100 * diagonal(whole)

    def within(margin: float) -> np.ndarray:
        limit = np.tan(np.arctan([0.7, 0.4]) + margin)
        return np.flatnonzero((np.abs(whole[:, :2]) < limit * whole[:, 2:]).all(axis=1))

    crop, inside = within(0.1), set(within(0.0).tolist())
    assert len(crop) < 0.9 * len(whole)
    seen = set(crop[visible_points(whole[crop], R)].tolist())
    assert seen & inside == set(visible_points(whole, R).tolist()) & inside
    # The radius is that of the whole cloud: with its own the crop looks different.
    own = set(crop[visible_points(whole[crop], 0.2 * R)].tolist())
    assert own & inside != seen & inside


def test_points_closer_than_the_merge_distance_are_one():
    rng = np.random.default_rng(0)
    points = small("far", 1) - np.array([0, 0, 490.0])
    twins = np.repeat(points, 3, axis=0) + rng.uniform(-2e-9, 2e-9, (3 * len(points), 3))
    seen = visible_points(twins, 100 * diagonal(points)) // 3
    assert len(set(seen.tolist())) == len(seen)
    expected = visible_by_hull(points, 100 * diagonal(points))
    assert places(points, np.unique(seen)) == places(points, expected)


def test_the_first_of_exact_duplicates_is_returned():
    points = street(2000, 1)
    doubled = np.concatenate([points, points])
    R = 100 * diagonal(points)
    assert visible_points(doubled, R).tolist() == visible_points(points, R).tolist()


def test_a_walk_that_does_not_end_searches_all_triangles(monkeypatch):
    points = street(3000, 2)
    expected = visible_points(points, 100 * diagonal(points))
    monkeypatch.setattr(visible, "MAX_STEPS", 0)
    assert np.array_equal(visible_points(points, 100 * diagonal(points)), expected)


def test_a_broken_triangulation_falls_back_on_the_hull(monkeypatch):
    points = street(3000, 2)
    expected = visible_points(points, 100 * diagonal(points))
    monkeypatch.setattr(visible, "lower_hull", lambda *_: False)
    assert np.array_equal(visible_points(points, 100 * diagonal(points)), expected)


def test_what_a_workspace_held_before_does_not_matter():
    clouds = [street(count, count) for count in (30_000, 500, 60_000, 5)]
    workspace = Workspace()
    for points in (*clouds, *clouds[::-1]):
        R = 100 * diagonal(points)
        assert np.array_equal(visible_points(points, R, workspace), visible_points(points, R))
    held = workspace.nbytes
    visible_points(clouds[2], 100 * diagonal(clouds[2]), workspace)
    assert workspace.nbytes == held


@pytest.mark.parametrize("z", [0.0, -1.0, np.nan])
def test_a_point_that_is_not_in_front_is_refused(z):
    points = street(100, 0)
    points[50] = 1.0, 1.0, z
    with pytest.raises(CardError, match="looks along"):
        visible_points(points, 1e4)


@pytest.mark.parametrize("radius", [1.0, 40.0])
def test_a_point_beyond_the_sphere_is_refused(radius):
    with pytest.raises(CardError, match="too far away"):
        visible_points(street(100, 0), radius)
