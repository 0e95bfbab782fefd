"""Geometry against OpenCV and scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from card.errors import CardError
from card.geometry import (
    CameraModel,
    Trajectory,
    apply,
    from_json,
    inverse,
    matrix_from_quaternion,
    quaternion_from_matrix,
    to_json,
    transform,
)

RNG = np.random.default_rng(7)
CAMERA = CameraModel(2248, 2252, 1605.0, 1604.0, 1123.5, 1125.5, (-0.1, 0.05, 0.0003, -0.0004, -0.01))


def test_quaternions_agree_with_scipy() -> None:
    rotations = Rotation.random(200, random_state=1)
    q = quaternion_from_matrix(rotations.as_matrix())
    np.testing.assert_allclose(q, rotations.as_quat(canonical=True, scalar_first=True), atol=1e-12)
    np.testing.assert_allclose(matrix_from_quaternion(q), rotations.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
def test_half_turns_survive_the_round_trip(axis: list[int]) -> None:
    half_turn = Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix()
    np.testing.assert_allclose(
        matrix_from_quaternion(quaternion_from_matrix(half_turn)), half_turn, atol=1e-12
    )


def test_inverse_and_document_round_trip() -> None:
    a_from_b = transform(RNG.normal(size=3), RNG.normal(size=4))
    points = RNG.normal(size=(10, 3))
    np.testing.assert_allclose(apply(inverse(a_from_b), apply(a_from_b, points)), points, atol=1e-12)
    np.testing.assert_allclose(from_json(to_json(a_from_b)), a_from_b, atol=1e-12)


def test_apply_takes_one_transform_a_point() -> None:
    transforms = transform(RNG.normal(size=(5, 3)), RNG.normal(size=(5, 4)))
    points = RNG.normal(size=(5, 3))
    expected = [apply(t, p[None])[0] for t, p in zip(transforms, points, strict=True)]
    np.testing.assert_allclose(apply(transforms, points), expected, atol=1e-12)


def test_trajectory_agrees_with_scipy_slerp() -> None:
    t = np.array([0, 10, 25, 40]) * 1_000_000
    rotations = Rotation.random(4, random_state=3)
    positions = RNG.normal(size=(4, 3))
    trajectory = Trajectory(t, positions, rotations.as_quat(scalar_first=True))
    query = RNG.integers(t[0], t[-1], 50)
    poses = trajectory.at(query)
    np.testing.assert_allclose(poses[:, :3, :3], Slerp(t, rotations)(query).as_matrix(), atol=1e-9)
    expected = np.stack([np.interp(query, t, positions[:, i]) for i in range(3)], axis=1)
    np.testing.assert_allclose(poses[:, :3, 3], expected, atol=1e-12)


def test_trajectory_refuses_to_extrapolate() -> None:
    trajectory = Trajectory([0, 10], np.zeros((2, 3)), [[1, 0, 0, 0]] * 2)
    with pytest.raises(CardError, match="does not cover"):
        trajectory.at([11])


def test_trajectory_refuses_times_that_go_back() -> None:
    with pytest.raises(CardError, match="do not increase"):
        Trajectory([0, 10, 5], np.zeros((3, 3)), [[1, 0, 0, 0]] * 3)


def test_projection_agrees_with_opencv() -> None:
    import cv2

    points = RNG.uniform([-5, -5, 8], [5, 5, 40], size=(100, 3))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), CAMERA.K, np.array(CAMERA.distortion))
    np.testing.assert_allclose(CAMERA.project(points), expected[:, 0], atol=1e-8)


def test_rays_invert_the_projection() -> None:
    uv = RNG.uniform([0, 0], [2247, 2251], size=(500, 2))
    np.testing.assert_allclose(CAMERA.project(CAMERA.rays(uv)), uv, atol=1e-7)


def test_points_behind_the_camera_have_no_pixel() -> None:
    assert np.isnan(CAMERA.project([[0.0, 0.0, -1.0]])).all()


def test_points_beyond_the_fold_of_the_distortion_have_no_pixel() -> None:
    lens = CameraModel(100, 100, 50.0, 50.0, 49.5, 49.5, (-0.3, 0.0, 0.0, 0.0, 0.0))
    fold = np.sqrt(1 / 0.9)  # where the derivative 1 - 0.9 r^2 vanishes
    pixels = lens.project([[0.99 * fold, 0.0, 1.0], [1.01 * fold, 0.0, 1.0]])
    assert np.isnan(pixels).tolist() == [[False, False], [True, True]]


def test_image_edges_are_half_a_pixel_out() -> None:
    inside = CAMERA.contains([[-0.5, -0.5], [2247.49, 2251.49], [2247.5, 0], [0, -0.51]])
    assert inside.tolist() == [True, True, False, False]
