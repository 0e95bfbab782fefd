"""Label boxes and depth maps on the pixel grid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from card.benchmark.boxes import box_span, inside
from card.benchmark.truth import View
from card.geometry import CameraModel, rasterize

CAMERA = CameraModel(20, 16, 18.0, 17.0, 9.4, 7.7, (-0.1, 0.02, 1e-3, 0.0, 0.0))


def mask(box: tuple[float, float, float, float], width: int, height: int) -> np.ndarray:
    found = np.zeros(width * height, dtype=bool)
    found[inside(np.arange(width * height), box_span(box, width, height), width)] = True
    return found.reshape(height, width)


def test_a_box_over_the_whole_image_holds_every_pixel() -> None:
    assert mask((0.5, 0.5, 1, 1), 7, 5).all()


def test_edges_lie_half_a_pixel_outside_the_centres() -> None:
    # Columns 2..3 of 8: edges at 1.5 and 3.5, in the label's units 2/8 and 4/8.
    found = mask((3 / 8, 0.5, 2 / 8, 1), 8, 4)
    assert np.flatnonzero(found.any(axis=0)).tolist() == [2, 3]


def test_a_box_beyond_the_image_is_cut_and_one_between_centres_is_empty() -> None:
    assert np.flatnonzero(mask((0, 0.5, 0.5, 1), 8, 2).any(axis=0)).tolist() == [0, 1]
    assert not mask((2 / 8, 0.5, 0.01, 1), 8, 2).any()


@given(st.tuples(*[st.floats(0, 1)] * 2, *[st.floats(0, 1)] * 2), st.integers(1, 30), st.integers(1, 30))
def test_a_mask_holds_the_centres_between_its_edges(box, width: int, height: int) -> None:
    x, y, w, h = box
    u, v = np.arange(width), np.arange(height)
    left, right = (x - w / 2) * width - 0.5, (x + w / 2) * width - 0.5
    top, bottom = (y - h / 2) * height - 0.5, (y + h / 2) * height - 0.5
    wanted = ((v >= top) & (v < bottom))[:, None] & ((u >= left) & (u < right))
    assert (mask(box, width, height) == wanted).all()


def random_points(count: int = 4000) -> np.ndarray:
    return np.random.default_rng(0).uniform([-6, -5, -1], [6, 5, 12], (count, 3))


def test_rasterize_keeps_the_nearest_of_each_rounded_pixel() -> None:
    depth = rasterize(random_points(), CAMERA)
    wanted = np.full((CAMERA.height, CAMERA.width), np.nan)
    for point in random_points()[random_points()[:, 2] > 0]:
        u, v = np.floor(CAMERA.project(point[None])[0] + 0.5)
        if 0 <= u < CAMERA.width and 0 <= v < CAMERA.height:
            wanted[int(v), int(u)] = np.fmin(wanted[int(v), int(u)], point[2])
    assert np.isfinite(wanted).sum() > 50
    np.testing.assert_array_equal(depth, wanted)


@pytest.mark.parametrize(
    "distortion", [(0.0,) * 5, (-0.1, 0.02, 1e-3, 0.0, 0.0), (-0.6, 0.3, 2e-3, 1e-3, -0.05)]
)
def test_the_compiled_depth_map_is_the_plain_one(distortion: tuple[float, ...]) -> None:
    camera = CameraModel(40, 30, 18.0, 17.0, 19.4, 14.7, distortion)
    view = View(camera)
    points = random_points(20_000).astype(np.float32)
    points[:5] = [[0, 0, 0], [np.nan, 0, 1], [0, 0, np.nan], [0, 0, 5], [0, 0, 5]]
    # Twice: the borrowed depth buffer must be as it was.
    for _ in range(2):
        pixels, depth = view.truth(points[3:], (0.1, 9.0))
        plain_pixels, plain_depth = view.truth(points[3:], (0.1, 9.0), plain=True)
        order = np.argsort(pixels)
        np.testing.assert_array_equal(pixels[order], plain_pixels)
        np.testing.assert_array_equal(depth[order], plain_depth)
    assert 100 < len(plain_depth) < 1200
    assert view.truth(points[:3], (0.1, 9.0))[0].size == 0


def test_the_compiled_rays_are_those_of_the_camera() -> None:
    view = View(CameraModel(40, 30, 28.0, 27.0, 19.4, 14.7, (-0.2, 0.05, 1e-3, -1e-3, 0.01)))
    np.testing.assert_allclose(view.rays, view.plain_rays(), atol=1e-12)


def test_rasterize_takes_a_point_on_a_pixels_ray_to_that_pixel() -> None:
    ray = CAMERA.rays([[3.0, 11.0]])[0]
    depth = rasterize([5 * ray, 9 * ray], CAMERA)
    assert depth[11, 3] == pytest.approx(5)
    assert np.isfinite(depth).sum() == 1


def test_rasterize_of_nothing_is_an_empty_map() -> None:
    assert np.isnan(rasterize(np.zeros((0, 3)), CAMERA)).all()
