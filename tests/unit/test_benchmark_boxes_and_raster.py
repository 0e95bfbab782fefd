"""Label boxes and depth maps on the pixel grid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from card.benchmark.boxes import box_mask
from card.geometry import CameraModel, rasterize

CAMERA = CameraModel(20, 16, 18.0, 17.0, 9.4, 7.7, (-0.1, 0.02, 1e-3, 0.0, 0.0))


def test_a_box_over_the_whole_image_holds_every_pixel() -> None:
    assert box_mask((0.5, 0.5, 1, 1), 7, 5).all()


def test_edges_lie_half_a_pixel_outside_the_centres() -> None:
    # Columns 2..3 of 8: edges at 1.5 and 3.5, in the label's units 2/8 and 4/8.
    mask = box_mask((3 / 8, 0.5, 2 / 8, 1), 8, 4)
    assert np.flatnonzero(mask.any(axis=0)).tolist() == [2, 3]


def test_a_box_beyond_the_image_is_cut_and_one_between_centres_is_empty() -> None:
    assert np.flatnonzero(box_mask((0, 0.5, 0.5, 1), 8, 2).any(axis=0)).tolist() == [0, 1]
    assert not box_mask((2 / 8, 0.5, 0.01, 1), 8, 2).any()


@given(st.tuples(*[st.floats(0, 1)] * 2, *[st.floats(0, 1)] * 2), st.integers(1, 30), st.integers(1, 30))
def test_a_mask_holds_the_centres_between_its_edges(box, width: int, height: int) -> None:
    x, y, w, h = box
    u, v = np.arange(width), np.arange(height)
    left, right = (x - w / 2) * width - 0.5, (x + w / 2) * width - 0.5
    top, bottom = (y - h / 2) * height - 0.5, (y + h / 2) * height - 0.5
    wanted = ((v >= top) & (v < bottom))[:, None] & ((u >= left) & (u < right))
    assert (box_mask(box, width, height) == wanted).all()


def test_rasterize_keeps_the_nearest_of_each_rounded_pixel() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([-6, -5, -1], [6, 5, 12], (4000, 3))
    depth = rasterize(points, CAMERA)
    wanted = np.full((CAMERA.height, CAMERA.width), np.nan)
    for point in points[points[:, 2] > 0]:
        u, v = np.floor(CAMERA.project(point[None])[0] + 0.5).astype(int)
        if 0 <= u < CAMERA.width and 0 <= v < CAMERA.height:
            wanted[v, u] = np.fmin(wanted[v, u], point[2])
    assert np.isfinite(wanted).sum() > 50
    np.testing.assert_array_equal(depth, wanted)


def test_rasterize_takes_a_point_on_a_pixels_ray_to_that_pixel() -> None:
    ray = CAMERA.rays([[3.0, 11.0]])[0]
    depth = rasterize([5 * ray, 9 * ray], CAMERA)
    assert depth[11, 3] == pytest.approx(5)
    assert np.isfinite(depth).sum() == 1


def test_rasterize_of_nothing_is_an_empty_map() -> None:
    assert np.isnan(rasterize(np.zeros((0, 3)), CAMERA)).all()
