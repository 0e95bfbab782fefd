import numpy as np
import pytest

from card.ground_truth.reference.mad import mad_inliers
from card.ground_truth.reference.thinning import pixels_covered, thin


def points_at_radii(radii: list[float]) -> np.ndarray:
    # Pairs on opposite sides leave the mean at zero, so the radii are as given.
    return np.array([[s * r, 0, 0] for r in radii for s in (1, -1)], dtype=np.float32)


def test_both_forms_by_hand():
    # radii 1 1 2 2 3 3 9 9: median 2.5, deviations 1.5 1.5 .5 .5 .5 .5 6.5 6.5, MAD (.5 + 1.5) / 2 = 1.
    points = points_at_radii([1, 2, 3, 9])
    voxel = np.zeros(8, dtype=np.int32)
    deviation = mad_inliers(voxel, points, 1.5, "deviation", 2)
    literal = mad_inliers(voxel, points, 1.5, "literal", 2)
    assert deviation.tolist() == [True] * 6 + [False] * 2
    assert literal.tolist() == [True] * 2 + [False] * 6
    assert mad_inliers(voxel, points, 1.5, "off", 9).all()


def test_a_voxel_with_too_few_inliers_is_dropped():
    points = points_at_radii([1, 2, 3, 9])
    assert not mad_inliers(np.zeros(8, dtype=np.int32), points, 1.5, "literal", 3).any()
    # One point is its own mean: r = 0 <= 0, a single inlier.
    assert mad_inliers(np.zeros(1, np.int32), points[:1], 1.5, "deviation", 2).tolist() == [False]
    assert mad_inliers(np.zeros(1, np.int32), points[:1], 1.5, "deviation", 1).tolist() == [True]


@pytest.mark.parametrize("form", ["deviation", "literal"])
@pytest.mark.parametrize("seed", range(4))
def test_equals_a_loop_over_voxels(form, seed):
    rng = np.random.default_rng(seed)
    voxel = rng.integers(0, 40, 600).astype(np.int32)
    points = rng.uniform(0, 0.1, (600, 3)).astype(np.float32)
    kept = mad_inliers(voxel, points, 1.5, form, 2)
    for v in np.unique(voxel):
        own = points[voxel == v].astype(np.float64)
        radii = np.linalg.norm(own - own.mean(axis=0), axis=1).astype(np.float32)
        mad = np.median(np.abs(radii - np.median(radii)))
        inlier = (np.abs(radii - np.median(radii)) if form == "deviation" else radii) <= np.float32(1.5) * mad
        assert kept[voxel == v].tolist() == (inlier & (inlier.sum() >= 2)).tolist()


def test_no_points():
    assert mad_inliers(np.zeros(0, np.int32), np.zeros((0, 3), np.float32), 1.5, "deviation", 2).shape == (0,)


@pytest.mark.parametrize("limit", [1, 2, 3, 7])
def test_thinning_keeps_the_limit_spread_over_each_voxel(limit):
    voxel = np.random.default_rng(0).integers(0, 30, 300).astype(np.int32)
    kept = thin(voxel, np.full(30, limit))
    for v in range(30):
        own = kept[voxel == v]
        assert own.sum() == min(limit, len(own))
        gaps = np.diff(np.flatnonzero(own))
        assert len(gaps) == 0 or gaps.max() - gaps.min() <= 1


def test_each_voxel_has_a_limit_of_its_own():
    voxel = np.repeat([2, 0, 1], [9, 9, 2]).astype(np.int32)
    kept = thin(voxel, np.array([1, 5, 4]))
    assert [int(kept[voxel == v].sum()) for v in range(3)] == [1, 2, 4]


def covered(points: np.ndarray, corners: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Of clouds (V, N, 3), metres from their corners, seen with focal lengths of 1600 and 1500 pixels."""
    voxel = np.repeat(np.arange(len(points)), points.shape[1]).astype(np.int32)
    offset = points.reshape(-1, 3).astype(np.float32)
    return pixels_covered(voxel, offset, corners, rotation, (1600.0, 1500.0), 0.5)


def test_a_patch_covers_the_pixels_of_its_outline():
    step = (np.arange(40) + 0.5) / 400
    one, other = np.meshgrid(step, step)
    facing = np.stack([one, other, 0 * one], axis=-1).reshape(-1, 3)
    # Ten metres away and 1.5 m below the camera: seen at 8.5 degrees.
    lying = np.stack([one, 0 * one, other], axis=-1).reshape(-1, 3)
    noisy = facing + np.random.default_rng(0).normal(0, 0.02, (1600, 1)) * [0, 0, 1]
    corners = np.array([[-0.05, -0.05, 10.0], [-0.05, 1.5, 9.95], [-0.05, -0.05, 10.0]])
    found = covered(np.array([facing, lying, noisy]), corners, np.eye(3))
    assert found[[0, 2]] == pytest.approx(16 * 15, rel=0.005)
    assert found[1] == pytest.approx(16 * 15 * 0.15, rel=0.005)


def test_pixels_covered_are_those_of_projected_points():
    rng = np.random.default_rng(3)
    clouds = rng.uniform(0, 0.1, (30, 50, 3)) * rng.choice([0.1, 1], (30, 1, 3))
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    corners = rng.uniform([-4, -2, 8], [4, 2, 40], (30, 3))
    at = corners[:, None] + clouds @ rotation.T
    image = at[..., :2] / at[..., 2:] * [1600, 1500]
    area = [12 * np.sqrt(np.linalg.det(np.cov(own.T, bias=True))) for own in image]
    assert covered(clouds, corners, rotation) == pytest.approx(area, rel=0.02)


def test_one_point_and_none_cover_nothing():
    single = pixels_covered(
        np.array([1], np.int32), np.zeros((1, 3), np.float32), np.ones((3, 3)), np.eye(3), (9.0, 9.0), 0.5
    )
    assert single.tolist() == [0, 0, 0]
