import numpy as np
import pytest
from scipy.spatial import ConvexHull

from card.artifacts import default_settings
from card.errors import CardError
from card.ground_truth.hidden_points import two_pass_visibility
from card.ground_truth.hpr.visible import visible_points
from card.ground_truth.selection import diagonal

SETTINGS = default_settings("ground_truth")


def hull_of_flipped(points: np.ndarray, radius: float) -> set[int]:
    distance = np.linalg.norm(points, axis=1, keepdims=True)
    flipped = points + 2 * (radius - distance) * points / distance
    vertices = ConvexHull(np.concatenate([flipped, np.zeros((1, 3))])).vertices
    return set(vertices.tolist()) - {len(points)}


def cloud(seed: int, count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(seed)
    z = rng.uniform(3, 40, count)
    wall = np.stack([rng.uniform(-0.4, 0.4, count) * z, rng.uniform(-0.2, 0.2, count) * z, z], axis=1)
    wall[::3, 2] = 8 + rng.normal(0, 0.01, len(wall[::3]))
    return wall


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("factor", [2, 100, 210])
def test_visible_set_is_the_hull_of_the_flipped_cloud(seed, factor):
    points = cloud(seed)
    radius = factor * diagonal(points)
    visible = visible_points(points, radius)
    assert set(visible.tolist()) == hull_of_flipped(points, radius)
    assert (np.diff(visible) > 0).all()


def test_a_wall_hides_what_is_right_behind_it():
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(-0.5, 0.5, 40))
    near = np.stack([u.ravel() * 5, v.ravel() * 5, np.full(u.size, 5.0)], axis=1)
    behind = np.array([[0.013, 0.017, 9.0], [1.003, 0.021, 12.0]])
    points = np.concatenate([near, behind])
    assert not set(visible_points(points, 100 * diagonal(points))) & {len(near), len(near) + 1}


@pytest.mark.parametrize("count", [0, 1, 3])
def test_too_few_points_hide_nothing(count):
    assert visible_points(cloud(0)[:count], 100.0).tolist() == list(range(count))


def test_points_in_one_plane_with_the_viewer_hide_nothing():
    points = np.stack([np.zeros(9), np.linspace(-1, 1, 9), np.linspace(3, 9, 9)], axis=1)
    assert visible_points(points, 1000.0).tolist() == list(range(9))


def test_two_passes_by_their_definition():
    static, key = cloud(1), cloud(2, 80)
    own = np.arange(len(static)) % 5 == 0
    D = 1.5 * diagonal(static)
    first, second, of_key = two_pass_visibility(static, own, key, D, SETTINGS)
    assert set(first.tolist()) == hull_of_flipped(static, 100 * D)
    survivors = [i for i in first.tolist() if not own[i]]
    seen = hull_of_flipped(np.concatenate([static[survivors], key]), 210 * D)
    assert second.tolist() == [i for n, i in enumerate(survivors) if n in seen]
    assert of_key.tolist() == [n for n in range(len(key)) if n + len(survivors) in seen]


def test_a_frame_without_static_points_keeps_its_keyframe():
    key = cloud(3, 50)
    first, second, of_key = two_pass_visibility(np.empty((0, 3)), np.empty(0, bool), key, 0.0, SETTINGS)
    assert len(first) == len(second) == 0
    with_viewer = diagonal(np.concatenate([key, np.zeros((1, 3))]))
    assert set(of_key.tolist()) == hull_of_flipped(key, 210 * with_viewer)


def test_a_speck_of_static_points_does_not_shrink_the_sphere():
    speck = np.array([10.0, 0.0, 40.0]) + 0.01 * cloud(4, 6)
    key = cloud(5, 200)
    _, _, of_key = two_pass_visibility(speck, np.zeros(6, bool), key, diagonal(speck), SETTINGS)
    D = diagonal(np.concatenate([speck, key, np.zeros((1, 3))]))
    seen = hull_of_flipped(np.concatenate([speck, key]), 210 * D)
    assert set((of_key + len(speck)).tolist()) == {n for n in seen if n >= len(speck)}


def test_a_point_beyond_the_sphere_is_refused():
    with pytest.raises(CardError, match="too far away"):
        visible_points(cloud(6), 1.0)


def test_hidden_point_removal_can_be_one_pass_or_off():
    static, key = cloud(1), cloud(2, 80)
    own = np.arange(len(static)) % 5 == 0
    D = 1.5 * diagonal(static)
    off = two_pass_visibility(static, own, key, D, SETTINGS | {"hidden_point_removal": "off"})
    assert [len(part) for part in off] == [len(static), (~own).sum(), len(key)]
    once = two_pass_visibility(static, own, key, D, SETTINGS | {"hidden_point_removal": "one_pass"})
    both = np.concatenate([static[~own], key])
    seen = visible_points(both, SETTINGS["hpr_first"] * D)
    assert len(once[0]) == len(static)
    found = np.concatenate([static[once[1]], key[once[2]]])
    assert np.array_equal(found, both[seen])
    assert len(found) < len(both)
