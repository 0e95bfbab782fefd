import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from card.errors import CardError
from card.geometry import Trajectory
from card.ground_truth.voxels import VoxelGrid, find, pack, unpack


def grid_at(x: float, y: float, z: float, size: float = 0.1) -> VoxelGrid:
    place = np.array([[x, y, z], [x + 1, y + 1, z]])
    return VoxelGrid.around(Trajectory([0, 1], place, [[1, 0, 0, 0]] * 2), size)


@pytest.mark.parametrize("centre", [(0, 0, 0), (-37.7, 12.3, -4.0), (1e6, -1e6, 300.0)])
def test_world_indices_are_the_floor_of_p_over_s(centre):
    grid = grid_at(*centre)
    points = np.random.default_rng(0).uniform(-80, 80, (2000, 3)) + centre
    world = grid.indices(points) + grid.first
    for point, index in zip(points.tolist(), world.tolist(), strict=True):
        assert index == [int(np.floor(c / 0.1)) for c in point]


def test_negative_coordinates_are_not_truncated():
    grid = grid_at(0, 0, 0)
    world = grid.indices(np.array([[-0.05, -0.1, 0.05], [-1e-9, -0.11, 0.1]])) + grid.first
    assert world.tolist() == [[-1, -1, 0], [-1, -2, 1]]


def test_origin_is_a_multiple_of_the_voxel_and_corners_hold_their_points():
    grid = grid_at(12.34, -56.78, 9.1)
    assert np.allclose(grid.origin / grid.size, np.rint(grid.origin / grid.size))
    points = np.random.default_rng(1).uniform(-50, 50, (500, 3))
    offset = points - grid.corners(grid.keys(points))
    assert offset.min() > -1e-9
    assert offset.max() < 0.1 + 1e-9


@given(st.lists(st.tuples(*[st.integers(0, 2**21 - 1)] * 3), min_size=1, max_size=40))
def test_keys_sort_as_indices_and_come_back(indices):
    array = np.array(sorted(indices), dtype=np.int64)
    keys = pack(array)
    assert np.array_equal(unpack(keys), array)
    assert np.array_equal(np.sort(keys), keys)


def test_find_gives_positions_or_minus_one():
    assert find(np.array([2, 5, 9]), np.array([9, 1, 5, 10])).tolist() == [2, -1, 1, -1]
    assert find(np.array([], dtype=np.int64), np.array([3])).tolist() == [-1]


def test_a_point_outside_the_grid_is_an_error():
    with pytest.raises(CardError, match="outside the voxel grid"):
        grid_at(0, 0, 0).keys(np.array([[-1500.0, 0, 0]]))
