"""Undistortion and stereo rectification, against OpenCV."""

import cv2
import numpy as np
import pytest

from card.errors import CardError
from card.geometry import CameraModel, apply, inverse, pixel_map, rectify, remap, transform

LEFT = CameraModel(160, 120, 150.0, 151.0, 80.5, 58.0, (-0.12, 0.03, 0.001, -0.0005, 0.002))
RIGHT = CameraModel(160, 120, 149.0, 150.5, 79.0, 61.0, (-0.1, 0.02, -0.0008, 0.0004, 0.0))
LEFT_FROM_RIGHT = transform([0.5, 0.01, -0.02], [0.9996, 0.01, -0.02, 0.015])


def test_corresponding_points_share_a_row_and_disparity_gives_depth() -> None:
    stereo = rectify(LEFT, RIGHT, LEFT_FROM_RIGHT)
    points = np.random.default_rng(0).uniform((-3, -2, 6), (3, 2, 40), (200, 3))
    left = apply(stereo.rectified_from_left, points)
    right = apply(stereo.rectified_from_right, apply(inverse(LEFT_FROM_RIGHT), points))
    u, v = stereo.camera.project(left).T
    u_right, v_right = stereo.camera.project(right).T
    np.testing.assert_allclose(v, v_right, atol=1e-9)
    np.testing.assert_allclose(stereo.camera.fx * stereo.baseline_m / (u - u_right), left[:, 2])
    homogeneous = np.stack([u, v, u - u_right, np.ones_like(u)], axis=1) @ stereo.Q.T
    np.testing.assert_allclose(homogeneous[:, :3] / homogeneous[:, 3:], left)
    assert stereo.baseline_m == pytest.approx(np.linalg.norm(LEFT_FROM_RIGHT[:3, 3]))


def test_the_maps_are_those_of_opencv() -> None:
    stereo = rectify(LEFT, RIGHT, LEFT_FROM_RIGHT)
    pairs = (
        (LEFT, stereo.rectified_from_left, stereo.left_map),
        (RIGHT, stereo.rectified_from_right, stereo.right_map),
    )
    for camera, rectified_from, found in pairs:
        theirs = cv2.initUndistortRectifyMap(
            camera.K,
            np.array(camera.distortion),
            rectified_from[:3, :3],
            stereo.camera.K,
            (160, 120),
            cv2.CV_32FC1,
        )
        np.testing.assert_allclose(found, np.stack(theirs, axis=-1), atol=2e-4)


def test_the_rotations_are_near_those_of_opencv() -> None:
    right_from_left = inverse(LEFT_FROM_RIGHT)
    theirs = cv2.stereoRectify(
        LEFT.K, np.array(LEFT.distortion), RIGHT.K, np.array(RIGHT.distortion), (160, 120),
        right_from_left[:3, :3], right_from_left[:3, 3], flags=cv2.CALIB_ZERO_DISPARITY,
    )  # fmt: skip
    stereo = rectify(LEFT, RIGHT, LEFT_FROM_RIGHT)
    # Both put x along the baseline; how the pair turns about it is a free choice.
    np.testing.assert_allclose(stereo.rectified_from_left[0, :3], theirs[0][0], atol=1e-9)
    assert np.trace(stereo.rectified_from_left[:3, :3] @ theirs[0].T) > 3 - 1e-3
    assert theirs[4][3, 2] == pytest.approx(stereo.Q[3, 2])


def test_sampling_is_that_of_opencv() -> None:
    rng = np.random.default_rng(1)
    image = cv2.GaussianBlur(rng.integers(0, 256, (120, 160, 3), dtype=np.uint8), (0, 0), 3)
    pixels = pixel_map(LEFT.undistorted(), LEFT)
    theirs = cv2.remap(image, pixels, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    ours = remap(image, pixels)
    inside = (pixels >= 0).all(-1) & (pixels[..., 0] <= 159) & (pixels[..., 1] <= 119)
    assert inside.mean() > 0.8
    # OpenCV rounds the place to 1/32 of a pixel.
    assert np.abs(ours[inside].astype(int) - theirs[inside]).max() <= 2
    assert ours.dtype == np.uint8
    assert not ours[~inside].any()


def test_an_identical_map_changes_nothing() -> None:
    camera = LEFT.undistorted()
    image = np.random.default_rng(2).integers(0, 256, (120, 160), dtype=np.uint8)
    np.testing.assert_array_equal(remap(image, np.rint(pixel_map(camera, camera))), image)


@pytest.mark.parametrize("x", [-0.5, 0.0])
def test_swapped_cameras_are_refused(x: float) -> None:
    with pytest.raises(CardError, match="not right of the left one"):
        rectify(LEFT, RIGHT, transform([x, 0, 0]))
