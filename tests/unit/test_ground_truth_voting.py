from collections import defaultdict

import numpy as np
import pytest

from card.artifacts import default_settings
from card.geometry import Trajectory
from card.ground_truth.quotas import meets_quotas, required_votes
from card.ground_truth.views import distinct_views
from card.ground_truth.voxel_map import build_voxel_map
from card.ground_truth.voxels import VoxelGrid

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
    grid = VoxelGrid.around(Trajectory([0, 1], np.stack([centre, centre]), [[1, 0, 0, 0]] * 2), 0.1)
    built = build_voxel_map(bursts, origins, grid, SETTINGS, chunk_points=250)

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
        assert built.centroids[v] + corner == pytest.approx(cloud.mean(axis=0), abs=1e-6)
        assert built.extents[v] == pytest.approx(np.linalg.norm(np.ptp(cloud, axis=0)), abs=1e-6)
        front = greedy(fronts[key], origins, 0.03)
        rear = greedy(rears[key], origins, 0.03)
        b = spread(front, origins)
        wanted = len(front) >= required_votes(b, 1, 4, 0.2, 0.9) and len(rear) >= required_votes(
            b, 1, 2, 0.2, 0.9
        )
        assert decisions[v] == wanted
        assert (built.front_views[v] > 0, built.rear_views[v] > 0) == (bool(front), bool(rear))
    assert not built.keys.size or built.extents.max() <= 0.1 * np.sqrt(3) + 1e-6


def test_the_map_does_not_depend_on_how_bursts_are_grouped():
    bursts, origins = random_bursts(9, np.zeros(3), 0.05)
    grid = VoxelGrid.around(Trajectory([0, 1], np.zeros((2, 3)), [[1, 0, 0, 0]] * 2), 0.1)
    maps = [build_voxel_map(bursts, origins, grid, SETTINGS, chunk_points=n) for n in (1, 500, 10**9)]
    for other in maps[1:]:
        assert np.array_equal(
            meets_quotas(maps[0].front_views, maps[0].rear_views, maps[0].baseline, SETTINGS),
            meets_quotas(other.front_views, other.rear_views, other.baseline, SETTINGS),
        )
        assert np.array_equal(maps[0].counts, other.counts)
        assert np.allclose(maps[0].centroids, other.centroids, atol=1e-6)
