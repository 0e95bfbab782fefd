import numpy as np
import pytest
from ground_truth_scene import calibration, write_mask
from hypothesis import given, settings
from hypothesis import strategies as st

from card.errors import CardError
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.raster_order import raster_order


@pytest.fixture
def camera(tmp_path):
    write_mask(tmp_path / "mask.png")
    return LeftCamera(calibration(), tmp_path / "mask.png")


def test_ego_mask_of_the_wrong_size_or_unreadable(tmp_path):
    write_mask(tmp_path / "mask.png", 160, 200)
    with pytest.raises(CardError, match=r"wrong size \(found 160 x 200, wanted 200 x 160"):
        LeftCamera(calibration(), tmp_path / "mask.png")
    (tmp_path / "mask.png").write_bytes(b"no image")
    with pytest.raises(CardError, match="unreadable ego mask"):
        LeftCamera(calibration(), tmp_path / "mask.png")


def test_ego_mask_is_read_in_the_undistorted_image(camera):
    # The mask begins at row 144; rows are rounded, (row - 79.5) / 120 is y / z.
    y = (np.array([143.4, 143.6, 150.0, 170.0, -9.0]) - 79.5) / 120
    points = np.stack([np.zeros(5), y, np.ones(5)], axis=1) * 7.0
    assert camera.on_ego(points).tolist() == [False, True, True, True, False]


def test_view_is_the_image_and_a_margin(camera):
    edge = camera.image.rays(np.array([[199.5, 79.5]]))[0, 0]
    angles = np.arctan(edge) + np.array([-0.01, 0.05, 0.15])
    points = np.stack([np.tan(angles), np.zeros(3), np.ones(3)], axis=1) * 5
    assert camera.in_view(points, 0.1, 0.3).tolist() == [True, True, False]
    assert not camera.in_view(-points, 0.1, 0.3).any()
    assert camera.in_view(points[:1] / 5 * 0.29, 0.1, 0.3).tolist() == [False]


def test_no_voxel_with_a_point_in_view_is_left_out(camera):
    rng = np.random.default_rng(0)
    centres = rng.uniform(-3, 3, (20000, 3)) + np.array([0, 0, 1])
    offsets = rng.normal(0, 1, (20000, 3))
    points = centres + 0.0866 * offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    seen = camera.in_view(points, 0.1, 0.3)
    wanted = camera.may_be_in_view(centres, 0.0866, 0.1, 0.3)
    assert not (seen & ~wanted).any()
    assert wanted.sum() < seen.sum() * 1.3


def test_raster_order_and_clip_to_the_original_image(camera):
    rng = np.random.default_rng(1)
    z = rng.uniform(1, 30, 3000)
    points = np.stack([rng.uniform(-1.5, 1.5, 3000) * z, rng.uniform(-1.2, 1.2, 3000) * z, z], axis=1)
    index, pixels = camera.raster(points)
    inside = camera.image.contains(camera.image.project(points))
    assert sorted(index.tolist()) == np.flatnonzero(inside & camera.in_view(points, 0, 0)).tolist()
    order = [(v, u, d) for (u, v), d in zip(pixels.tolist(), points[index, 2].tolist(), strict=True)]
    assert order == sorted(order)
    assert np.abs(camera.image.project(points[index]) - pixels).max() <= 0.5


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "distortion",
    [(0.0,) * 5, (-0.1, 0.0, 0.0, 0.0, 0.0), (0.08, -0.03, 0.002, -0.003, 0.01), (-0.06, 0.01, 0.004, 0, 0)],
)
def test_compiled_pixels_are_those_of_the_camera_model(tmp_path, seed, distortion):
    document = calibration()
    document["cameras"]["camera_left"]["distortion"] = list(distortion)
    write_mask(tmp_path / "mask.png")
    camera = LeftCamera(document, tmp_path / "mask.png")
    rng = np.random.default_rng(seed)
    points = rng.uniform((-3, -3, -0.2), (3, 3, 3), (2000, 3))
    # Some exactly on an axis, some in the plane of the camera, some at its centre.
    points[:300, 0], points[200:400, 1], points[350:450, 2] = 0.0, 0.0, 0.0
    index, pixels = camera.raster(points)
    plain = camera.image.project(points)
    inside = camera.image.contains(plain) & camera.in_view(points, 0.0, 0.0)
    assert np.array_equal(np.sort(index), np.flatnonzero(inside))
    assert np.array_equal(pixels, np.rint(plain[index]))


def test_distortion_that_folds_back_brings_nothing_onto_the_image(tmp_path):
    document = calibration()
    document["cameras"]["camera_left"]["distortion"] = [-0.1, 0.0, 0.0, 0.0, 0.0]
    write_mask(tmp_path / "mask.png")
    camera = LeftCamera(document, tmp_path / "mask.png")
    # x (1 - 0.1 x^2) turns back at x = 1.83 and is zero again at 3.16.
    far = np.array([[3.1 * 5, 0.0, 5.0]])
    assert camera.image.contains(camera.image.distort(far[:, :2] / far[:, 2:]) * 120 + [99.5, 79.5]).all()
    assert len(camera.raster(far)[0]) == 0


def test_raster_order_decides_ties_of_depth_by_x_and_y(camera):
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(-0.02, 0.02, (4000, 2)), rng.integers(1, 4, 4000)] * (1, 1, 0.5)
    points = np.concatenate([points, points[:50]])
    index, pixels = camera.raster(points)
    assert len(index) == len(points)
    column, row = pixels.T
    x, y, z = points[index].T
    expected = np.lexsort((y, x, z, column, row))
    assert np.array_equal(points[index], points[index][expected])
    assert np.array_equal(pixels, pixels[expected])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 3)] * 5), max_size=60))
def test_points_are_saved_by_row_column_depth_x_and_y(rows):
    table = np.array(rows, dtype=np.int64).reshape(-1, 5)
    points, (column, row) = table[:, :3] * 0.1 + 1, table[:, 3:].T
    order = raster_order(points, column, row)
    plain = np.lexsort((points[:, 1], points[:, 0], points[:, 2], column, row))
    assert np.array_equal(np.sort(order), np.arange(len(points)))
    assert np.array_equal(table[order], table[plain])
