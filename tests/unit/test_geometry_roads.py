"""Heights over the road plane at frames and between them, and back."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.errors import CardError
from card.geometry import Roads, height_above_road, points_above_road, transform

T_NS = 1_776_157_200_000_000_000 + np.arange(5) * 100_000_000


def roads(valid: NDArray[np.bool_] | None = None) -> Roads:
    quaternion = Rotation.from_euler("XY", np.arange(10).reshape(5, 2) / 100).as_quat()[:, [3, 0, 1, 2]]
    translation = np.stack([np.zeros(5), np.zeros(5), 1.7 + np.arange(5) / 100], axis=1)
    table = {
        "frame": np.arange(3, 8),
        "t_ns": T_NS,
        "valid": np.ones(5, dtype=bool) if valid is None else valid,
    }
    table |= {axis: translation[:, i] for i, axis in enumerate("xyz")}
    table |= {f"q{axis}": quaternion[:, i] for i, axis in enumerate("wxyz")}
    return Roads.from_table(table)


def test_points_over_the_road_undo_heights() -> None:
    road = roads().at(int(T_NS[2]))
    points = np.random.default_rng(0).normal(0, 5, (50, 3))
    height = height_above_road(points, road)
    np.testing.assert_allclose(points_above_road(points, height, road), points, atol=1e-12)
    down = points_above_road(points, np.zeros(50), road)
    np.testing.assert_allclose(height_above_road(down, road), 0, atol=1e-12)
    # Along the normal, by the height.
    np.testing.assert_allclose(points - down, height[:, None] * road[2, :3], atol=1e-12)


def test_times_of_frames_and_between() -> None:
    found = roads()
    np.testing.assert_array_equal(found.at(int(T_NS[1])), found.by_frame()[4])
    rig = np.zeros((1, 3))
    assert found.height_above_road(rig, int(T_NS[1]))[0] == pytest.approx(1.71)
    assert found.height_above_road(rig, int(T_NS[1]) + 50_000_000)[0] == pytest.approx(1.715)
    up = found.points_above_road(rig, np.array([2.0]), int(T_NS[1]) + 50_000_000)
    assert found.height_above_road(up, int(T_NS[1]) + 50_000_000)[0] == pytest.approx(2.0)


def test_planes_that_are_not_valid_are_not_given() -> None:
    found = roads(np.array([True, True, False, True, True]))
    assert sorted(found.by_frame()) == [3, 4, 6, 7]
    found.at(int(T_NS[1]))
    for t_ns in (T_NS[2], T_NS[1] + 1, T_NS[2] + 1, T_NS[0] - 1, T_NS[4] + 1):
        with pytest.raises(CardError, match="no road plane at a time"):
            found.at(int(t_ns))


def test_a_plane_is_its_transform() -> None:
    found = roads()
    quaternion = Rotation.from_euler("XY", [0.04, 0.05]).as_quat()[[3, 0, 1, 2]]
    np.testing.assert_allclose(found.road_from_rig[2], transform([0, 0, 1.72], quaternion), atol=1e-12)
