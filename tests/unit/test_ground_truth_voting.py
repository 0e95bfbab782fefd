import dataclasses
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from card.artifacts import default_settings
from card.errors import CardError
from card.geometry import Trajectory
from card.ground_truth import voxel_map
from card.ground_truth.quotas import meets_quotas, required_votes
from card.ground_truth.reference.views import distinct_views
from card.ground_truth.reference.voxel_map import build_voxel_map as plain_voxel_map
from card.ground_truth.voxel_map import VoxelMap, build_voxel_map
from card.ground_truth.voxels import OFFSET_STEPS, VoxelGrid

SETTINGS = default_settings("ground_truth")


@pytest.mark.parametrize(
    ("baseline", "front", "rear"),
    [(0, 4, 2), (0.2, 4, 2), (0.9, 1, 1), (5, 1, 1), (0.3, 4, 2), (0.32, 3, 2), (0.54, 3, 2), (0.56, 2, 1)],
)
def test_quotas_at_and_between_the_anchors(baseline, front, rear):
    assert required_votes(baseline, 1, 4, 0.2, 0.9) == front
    assert required_votes(baseline, 1, 2, 0.2, 0.9) == rear


def test_quotas_round_halves_up():
    # v = 2 - (b - 0.2) / 0.7 is 1.5 at 0.55; numpy would round 2.5 down.
    assert required_votes(0.55, 1, 2, 0.2, 0.9) == 2
    assert required_votes(0.2 + 0.7 / 2, 1, 4, 0.2, 0.9) == 3


def test_halves_go_up_or_to_the_even_number():
    halves = [0.55, 0.2 + 0.7 / 6, 0.2 + 0.7 / 2, 0.2 + 0.7 * 5 / 6]
    for rounding, wanted in (("half_up", [2, 4, 3, 2]), ("half_even", [2, 4, 2, 2])):
        found = [
            required_votes(b, 1, v, 0.2, 0.9, rounding) for b, v in zip(halves, (2, 4, 4, 4), strict=True)
        ]
        assert found == wanted
    assert required_votes(0.4, 1, 4, 0.2, 0.9, "half_even") == required_votes(0.4, 1, 4, 0.2, 0.9)


def greedy(views: list[int], origins: np.ndarray, spacing: float) -> list[int]:
    accepted: list[int] = []
    for view in views:
        if all(np.linalg.norm(origins[view] - origins[other]) >= spacing for other in accepted):
            accepted.append(view)
    return accepted


def spread(views: list[int], origins: np.ndarray) -> float:
    return max((float(np.linalg.norm(origins[a] - origins[b])) for a in views for b in views), default=0.0)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("far", [np.inf, 0.3])
def test_greedy_gate_equals_a_loop(seed, far):
    rng = np.random.default_rng(seed)
    origins = np.cumsum(rng.normal(0, 0.03, (40, 3)), axis=0)
    pairs = sorted({(int(v), int(b)) for v, b in rng.integers(0, (30, 40), (400, 2))})
    voxel, burst = np.array(pairs).T
    views = distinct_views(voxel, burst, origins, 31, 0.05, 4, far)
    for v in range(31):
        wanted = greedy([b for w, b in pairs if w == v], origins, 0.05)
        if views.settled[v]:
            assert len(wanted) >= views.count[v] >= 4
            assert spread(wanted, origins) + 1e-12 >= views.baseline[v] >= far
        else:
            assert views.count[v] == len(wanted)
            assert views.baseline[v] == pytest.approx(spread(wanted, origins), abs=1e-12)
            assert views.burst[views.voxel == v].tolist() == wanted
    assert views.settled.any() == np.isfinite(far)


def test_a_view_exactly_at_the_spacing_counts():
    origins = np.array([[0.0, 0, 0], [0.03, 0, 0], [0.05, 0, 0]])
    views = distinct_views(np.zeros(3, int), np.arange(3), origins, 1, 0.03, 4, 0.9)
    assert views.count[0] == 2


def random_bursts(seed: int, centre: np.ndarray, speed: float):
    rng = np.random.default_rng(seed)
    bursts = []
    origins = centre + np.cumsum(rng.normal(0, speed, (30, 3)), axis=0)
    for i in range(30):
        points = np.concatenate(
            [rng.normal(0, 0.12, (60, 3)), rng.uniform(-1, 1, (30, 3)), np.zeros((rng.integers(2), 3))]
        )
        bursts.append((i, bool(rng.integers(2)), points + centre))
    return bursts, origins


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (1e6, -1e6, 100.0)])
@pytest.mark.parametrize("speed", [0.0, 0.02, 0.3])
def test_voxel_map_equals_a_dict(seed, centre, speed):
    centre = np.array(centre)
    bursts, origins = random_bursts(seed, centre, speed)
    grid = grid_round(centre)
    built = build_voxel_map(bursts, origins, grid, SETTINGS)

    points, fronts, rears = defaultdict(list), defaultdict(list), defaultdict(list)
    for i, front, cloud in bursts:
        for point, key in zip(cloud, grid.keys(cloud).tolist(), strict=True):
            points[key].append(point)
            views = (fronts if front else rears)[key]
            if i not in views:
                views.append(i)
    assert built.keys.tolist() == sorted(points)
    decisions = meets_quotas(built.front_views, built.rear_views, built.baseline, SETTINGS)
    for v, key in enumerate(built.keys.tolist()):
        cloud = np.array(points[key])
        assert built.counts[v] == len(cloud)
        corner = grid.corners(np.array([key]))[0]
        # A place is known to half a step, a distance to one.
        step = 0.1 / OFFSET_STEPS
        assert built.centroids[v] + corner == pytest.approx(cloud.mean(axis=0), abs=step / 2 + 1e-9)
        assert built.extents[v] == pytest.approx(np.linalg.norm(np.ptp(cloud, axis=0)), abs=2 * step)
        front = greedy(fronts[key], origins, 0.03)
        rear = greedy(rears[key], origins, 0.03)
        b = spread(front, origins)
        wanted = len(front) >= required_votes(b, 1, 4, 0.2, 0.9) and len(rear) >= required_votes(
            b, 1, 2, 0.2, 0.9
        )
        assert decisions[v] == wanted
        assert (built.front_views[v] > 0, built.rear_views[v] > 0) == (bool(front), bool(rear))
    assert not built.keys.size or built.extents.max() <= 0.1 * np.sqrt(3) + 1e-6


def grid_round(centre: np.ndarray) -> VoxelGrid:
    return VoxelGrid.around(Trajectory([0, 1], np.stack([centre, centre]), [[1, 0, 0, 0]] * 2), 0.1)


def assert_same(one, other) -> None:
    for field in dataclasses.fields(VoxelMap):
        if field.name != "grid":
            assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), field.name


@pytest.mark.parametrize("chunk_points", [1, 250, 10**9])
@pytest.mark.parametrize("speed", [0.0, 0.005, 0.05, 0.3])
def test_the_compiled_map_is_the_plain_one_however_that_groups_its_bursts(chunk_points, speed):
    bursts, origins = random_bursts(9, np.zeros(3), speed)
    built = build_voxel_map(bursts, origins, grid_round(np.zeros(3)), SETTINGS)
    assert_same(built, plain_voxel_map(bursts, origins, built.grid, SETTINGS, chunk_points))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.booleans(), st.lists(st.tuples(*[st.integers(-9, 9)] * 3), max_size=12)),
        min_size=1,
        max_size=25,
    ),
    st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=25, max_size=25),
    st.sampled_from([(0.0, 0.0, 0.0), (-1e-7, 0.05, -0.05), (4e5, -5.3e6, 600.0)]),
    st.sampled_from([0.01, 0.03, 0.2]),
    st.sampled_from(
        [{}, {"front_votes_max": 1, "rear_votes_max": 4}, {"baseline_far_m": 0.1}, {"rear_view_spacing_m": 0}]
    ),
)
def test_the_compiled_map_is_the_plain_one_on_any_bursts(clouds, places, centre, pitch, changed):
    """Points on a coarse lattice: on faces of voxels, on both sides of zero, far away, many alike."""
    grid, filled = grid_round(np.array(centre)), SETTINGS | changed
    origins = np.array(places) * 0.02 + centre
    bursts = [
        (i, front, np.array(cloud, dtype=np.float64).reshape(-1, 3) * pitch + centre)
        for i, (front, cloud) in enumerate(clouds)
    ]
    built = build_voxel_map(bursts, origins, grid, filled)
    assert_same(built, plain_voxel_map(bursts, origins, grid, filled, chunk_points=20))


def test_the_compiled_map_grows(monkeypatch):
    monkeypatch.setattr(voxel_map, "_CHUNK", 1000)
    rng = np.random.default_rng(0)
    bursts = [(i, i % 2 == 0, rng.uniform(-8, 8, (30_000, 3))) for i in range(8)]
    origins = rng.normal(0, 0.3, (8, 3))
    built = build_voxel_map(bursts, origins, grid_round(np.zeros(3)), SETTINGS)
    assert len(built.keys) > 1 << 17
    assert_same(built, plain_voxel_map(bursts, origins, built.grid, SETTINGS))


def test_sums_of_offsets_go_beyond_32_bits():
    bursts = [(i, True, np.full((300_000, 3), 0.0999)) for i in range(5)]
    built = build_voxel_map(bursts, np.zeros((5, 3)), grid_round(np.zeros(3)), SETTINGS)
    assert built.counts.tolist() == [1_500_000]
    assert built.centroids[0] == pytest.approx(np.full(3, 0.0999), abs=0.1 / OFFSET_STEPS)


def test_without_a_spacing_every_rear_burst_is_a_view():
    bursts = [(i, i == 0, np.zeros((3, 3))) for i in range(4)]
    filled = SETTINGS | {"rear_view_spacing_m": 0, "rear_votes_max": 3}
    for build in (build_voxel_map, plain_voxel_map):
        assert build(bursts, np.zeros((4, 3)), grid_round(np.zeros(3)), filled).rear_views.tolist() == [3]
        assert build(bursts, np.zeros((4, 3)), grid_round(np.zeros(3)), SETTINGS).rear_views.tolist() == [1]


def test_no_points_make_an_empty_map():
    nothing = [(0, True, np.empty((0, 3)))]
    built = build_voxel_map(nothing, np.zeros((1, 3)), grid_round(np.zeros(3)), SETTINGS)
    assert len(built.keys) == len(built.hit_by_both) == 0


def test_a_point_outside_the_grid_is_an_error_of_the_compiled_map():
    grid = grid_round(np.zeros(3))
    for far in (-1500.0, 3e5):
        cloud = np.array([[0.0, 0, 0], [0.0, far, 0]])
        with pytest.raises(CardError, match="point outside the voxel grid"):
            build_voxel_map([(0, True, cloud)], np.zeros((1, 3)), grid, SETTINGS)
