import numpy as np
import pytest

from card.ground_truth.reference.mad import mad_inliers
from card.ground_truth.reference.thinning import pixel_limit, thin


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


def test_a_voxel_keeps_a_point_for_so_many_pixels_that_it_covers():
    # 10 cm at 10 m and a focal length of 1600 pixels: 16 by 16 of them.
    depths = np.array([10.0, 20.0, 40.0, 500.0])
    assert pixel_limit(depths, 0.1, 1600.0, 2.0).tolist() == [128, 32, 8, 1]
