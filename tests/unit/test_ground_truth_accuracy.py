"""The measures of benchmarks/ for the ground truth, on cases worked out by hand."""

from pathlib import Path

import numpy as np
import pytest

from card.geometry import Trajectory
from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import VoxelGrid

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def measures(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import mesh_truth
    import static_truth

    return static_truth, mesh_truth


def test_scores_of_a_static_set(measures):
    static_truth, _ = measures
    grid = VoxelGrid.around(Trajectory([0, 1], np.zeros((2, 3)), [[1, 0, 0, 0]] * 2), 0.1)
    front, rear = np.array([1, 1, 1, 1, 1, 1, 0]), np.array([1, 1, 1, 1, 1, 1, 5])
    counts = np.array([10, 10, 10, 10, 10, 10, 10], np.int32)
    voxels = VoxelMap(grid, np.arange(7), counts, *[np.zeros(7)] * 2, front, rear, *[np.zeros(7)] * 3)
    # Two dynamic voxels, one on the edge that is static, three static; the last no front LiDAR hit.
    moving = np.array([10, 6, 5, 0, 0, 0, 10])
    found = static_truth.scores(voxels, moving, np.array([1, 3, 4, 5, 6]))
    assert found["SA"] == pytest.approx(75)
    assert found["DA"] == pytest.approx(50)
    assert found["AA"] == pytest.approx(np.sqrt(75 * 50))
    assert found["HA"] == pytest.approx(60)
    assert found["point_DA"] == pytest.approx(100 * 15 / 31)
    assert found["point_DA_two_lidars"] == pytest.approx(100 * 15 / 21)


def test_errors_along_rays_of_a_wall(measures, tmp_path):
    _, mesh_truth = measures
    corners = np.array([[-9, 10, -9], [9, 10, -9], [9, 10, 9], [-9, 10, 9]], np.float64)
    np.savez(tmp_path / "world.npz", vertices=corners, triangles=[[0, 1, 2], [0, 2, 3]])
    mesh = mesh_truth.Mesh(tmp_path / "world.npz")
    points = np.array([[0, 10.02, 0], [5, 9.99, 1], [0, 5, 0], [2, 14, 2]], np.float64)
    assert mesh.distance(points) == pytest.approx([0.02, 0.01, 5, 4], abs=1e-5)
    assert mesh.occluded(np.zeros(3), points).tolist() == [False, False, False, True]
    errors = mesh.ray_errors(np.zeros(3), points)
    distance = np.linalg.norm(points[1])
    assert errors.error == pytest.approx([0.02, -0.01 * distance / 9.99], abs=1e-5)
    assert errors.incidence == pytest.approx([0, np.degrees(np.arccos(9.99 / distance))], abs=1e-3)


def test_the_floor_compares_like_with_like(measures):
    _, mesh_truth = measures
    rng = np.random.default_rng(0)

    def errors(near: int, far: int, scale: float):
        sizes = np.r_[np.full(near, 0.004), np.full(far, 0.04)] * scale
        ranges = np.r_[np.full(near, 3.0), np.full(far, 30.0)]
        return mesh_truth.RayErrors(rng.normal(0, sizes), ranges, np.full(near + far, 80.0))

    # Mostly near against mostly far: pooled medians would say 0.1.
    assert mesh_truth.floor_ratio(errors(20_000, 2_000, 1.1), errors(2_000, 20_000, 1.0)) == pytest.approx(
        1.1, abs=0.05
    )
    assert np.isnan(mesh_truth.floor_ratio(errors(10, 10, 1.0), errors(3, 3, 1.0)))
