"""The road plane through four contacts."""

import numpy as np

from card.geometry import apply, height_above_road
from card.wheels.road_plane import fit_road_planes

RIG = np.array([[-0.8, 0.75, -1.7], [0.8, 0.75, -1.7], [-0.8, -2.1, -1.7], [0.8, -2.1, -1.7]])


def contacts(frames: int) -> np.ndarray:
    return RIG + np.random.default_rng(0).normal(0, 0.03, (frames, 4, 3))


def test_planes_agree_with_lstsq() -> None:
    points = contacts(20)
    planes = fit_road_planes(points)
    for i, four in enumerate(points):
        design = np.column_stack([four[:, :2], np.ones(4)])
        (a, b, c), squares, _, _ = np.linalg.lstsq(design, four[:, 2], rcond=None)
        normal = np.array([-a, -b, 1]) / np.linalg.norm([a, b, 1])
        np.testing.assert_allclose(planes.normal[i], normal, atol=1e-12)
        np.testing.assert_allclose(planes.offset_m[i], -normal[2] * c, atol=1e-12)
        np.testing.assert_allclose(planes.residual_m[i], np.sqrt(squares[0] / 4), atol=1e-12)


def test_one_lifted_wheel_leaves_a_quarter_at_each() -> None:
    lifted = RIG.copy()
    lifted[0, 2] += 0.08
    planes = fit_road_planes(lifted[None])
    np.testing.assert_allclose(planes.residual_m, 0.02, atol=1e-12)


def test_road_frame_is_under_the_rig_and_faces_forward() -> None:
    planes = fit_road_planes(contacts(20))
    road_from_rig = planes.road_from_rig()
    for matrix, normal, offset in zip(road_from_rig, planes.normal, planes.offset_m, strict=True):
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix[:3, :3]) > 0
        np.testing.assert_allclose(matrix[:3, 3], [0, 0, offset], atol=1e-12)
        np.testing.assert_allclose(matrix[:3, :3] @ normal, [0, 0, 1], atol=1e-12)
        assert abs((matrix[:3, :3] @ [0, 1, 0])[0]) < 1e-12
        points = np.random.default_rng(1).normal(0, 5, (30, 3))
        np.testing.assert_allclose(height_above_road(points, matrix), points @ normal + offset, atol=1e-12)


def test_contacts_of_a_flat_road_have_no_height() -> None:
    planes = fit_road_planes(RIG[None])
    road_from_rig = planes.road_from_rig()[0]
    np.testing.assert_allclose(height_above_road(RIG, road_from_rig), 0, atol=1e-12)
    np.testing.assert_allclose(apply(road_from_rig, np.array([[0, 2.0, -1.7]])), [[0, 2, 0]], atol=1e-12)


def test_no_frames_no_planes() -> None:
    planes = fit_road_planes(np.zeros((0, 4, 3)))
    assert planes.road_from_rig().shape == (0, 4, 4)
