"""The compiled map and registration against plain numpy, numeric derivatives and small_gicp."""

import numpy as np
import pytest
import small_gicp
from scipy.spatial.transform import Rotation

from card.estimation import plane_kernels as kernels
from card.estimation.motion_compensation import compensate
from card.estimation.plane_map import PlaneMap, PlaneSettings
from card.geometry import apply, inverse, transform
from card.geometry.corrections import correct_points

LEAF = 1.0


def corner(count: int = 6000, noise: float = 0.004, seed: int = 0) -> np.ndarray:
    """Points (3 x count, 3) on a floor and two walls."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0.1, 9.9, (2, 3, count))
    zero = np.zeros(count)
    faces = [np.stack(face, axis=1) for face in ((u[0], v[0], zero), (u[1], zero, v[1]), (zero, u[2], v[2]))]
    points = np.concatenate(faces) + np.array([0.31, 0.27, 0.43])
    return points + rng.normal(0, noise, points.shape)


def trunks(seed: int = 0) -> np.ndarray:
    """Points on thin upright cylinders: nothing flat."""
    rng = np.random.default_rng(seed)
    where = np.random.default_rng(99).uniform(-15, 15, (25, 2))
    angle, height = rng.uniform(0, 2 * np.pi, (25, 150)), rng.uniform(0, 4, (25, 150))
    x = where[:, :1] + 0.12 * np.cos(angle)
    y = where[:, 1:] + 0.12 * np.sin(angle)
    return np.stack([x, y, height], axis=2).reshape(-1, 3)


def rings(sensor: np.ndarray, seed: int) -> np.ndarray:
    """What 32 channels turning 2 m over flat ground see of it and of the trunks, in the sensor (4, 4)."""
    rng = np.random.default_rng(seed)
    azimuth, down = np.meshgrid(np.arange(0, 2 * np.pi, 0.006), np.radians(np.arange(3.5, 17.0)))
    rough = rng.normal(0, 0.002, azimuth.shape)
    far = (2.0 + rough) / np.tan(down)
    ground = np.stack([far * np.sin(azimuth), far * np.cos(azimuth), rough - 2.0], axis=2).reshape(-1, 3)
    wood = trunks(seed) * (2.0, 2.0, 1.0) - (0.0, 0.0, 2.0)
    return np.concatenate([ground, apply(inverse(sensor), wood)])


def small_pose(seed: int, turn: float, shift: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(rng.normal(0, turn, 3)).as_matrix()
    pose[:3, 3] = rng.normal(0, shift, 3)
    return pose


def voxels(points: np.ndarray, leaf: float) -> dict[tuple[int, ...], np.ndarray]:
    """Points by voxel, in order of appearance."""
    found: dict[tuple[int, ...], list[np.ndarray]] = {}
    for point in points:
        found.setdefault(tuple(np.floor(point / leaf).astype(int)), []).append(point)
    return {key: np.array(values) for key, values in found.items()}


def test_voxel_means_are_those_of_plain_numpy() -> None:
    points = corner(400)
    plain = np.stack([values.mean(axis=0) for values in voxels(points, 0.5).values()])
    np.testing.assert_allclose(kernels.voxel_means(points, 0.5), plain, atol=1e-12)
    assert len(kernels.voxel_means(np.zeros((0, 3)), 0.5)) == 0


def test_planes_are_those_of_plain_eigenvalues() -> None:
    points = corner(1500)
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF))
    grid.insert(points)
    level = grid._levels[0]
    plain = voxels(points, LEAF)
    assert len(grid) == len(plain)
    checked = 0
    for slot, values in enumerate(plain.values()):
        plane = level._planes[slot]
        if len(values) < grid.settings.min_points:
            assert plane[kernels.VALID] == kernels.UNKNOWN
            continue
        value, vector = np.linalg.eigh(np.cov(values.T, bias=True))
        np.testing.assert_allclose(plane[kernels.MEAN : kernels.MEAN + 3], values.mean(axis=0), atol=1e-9)
        np.testing.assert_allclose(plane[kernels.THIN], value[0], atol=1e-10)
        if plane[kernels.VALID] == kernels.IS_PLANE:
            normal = plane[kernels.NORMAL : kernels.NORMAL + 3]
            assert abs(normal @ vector[:, 0]) == pytest.approx(1, abs=1e-6)
            checked += 1
        else:
            wanted = np.linalg.inv(np.cov(values.T, bias=True) + kernels.BLOB_SIGMA**2 * np.eye(3))
            upper = plane[kernels.BLOB : kernels.BLOB + 6]
            np.testing.assert_allclose(upper, wanted[np.triu_indices(3)], rtol=1e-6, atol=1e-6)
    assert checked > 50


@pytest.mark.parametrize(("scene", "max_thickness_m"), [(corner, 0.06), (trunks, 1e-6)])
def test_normal_equations_are_the_derivatives_of_the_cost(scene: object, max_thickness_m: float) -> None:
    points = scene(seed=0)  # type: ignore[operator]
    # Of the trunks nothing counts as flat: blobs alone.
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF, max_thickness_m=max_thickness_m))
    grid.insert(points)
    scan, pose = points[::40], small_pose(3, 1e-3, 0.004)
    H, b = np.zeros((6, 6)), np.zeros(6)

    def gradient(step: np.ndarray) -> np.ndarray:
        moved = np.eye(4)
        moved[:3, :3], moved[:3, 3] = Rotation.from_rotvec(step[:3]).as_matrix(), step[3:]
        h, g = np.zeros((6, 6)), np.zeros(6)
        # A kernel this wide weighs all points alike: Gauss-Newton's normal equations are exact derivatives.
        grid._linearize(scan, pose @ moved, 1e6, h, g)
        return g

    grid._linearize(scan, pose, 1e6, H, b)
    np.testing.assert_allclose(H, H.T)
    step = 1e-6
    numeric = np.stack([(gradient(step * e) - gradient(-step * e)) / (2 * step) for e in np.eye(6)], axis=1)
    # Residuals are small here, so second derivatives add little.
    np.testing.assert_allclose(-numeric, H, atol=0.02 * np.abs(H).max())


def test_a_scan_is_put_where_it_belongs_as_small_gicp_puts_it() -> None:
    target, true = corner(seed=1), small_pose(5, 0.01, 0.1)
    scan = apply(inverse(true), corner(seed=2))
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF))
    grid.insert(target)
    found = grid.register(kernels.voxel_means(scan, 0.3), np.eye(4), widen=10.0)
    np.testing.assert_allclose(found.map_from_scan, true, atol=1e-3)
    assert found.inlier_fraction > 0.85
    assert found.rms_m < 0.006
    witness = small_gicp.align(target, scan, downsampling_resolution=0.2, max_iterations=50)
    np.testing.assert_allclose(found.map_from_scan, witness.T_target_source, atol=4e-3)


def test_moving_things_do_not_pull() -> None:
    target, true = corner(seed=1), small_pose(6, 0.005, 0.03)
    scan = apply(inverse(true), corner(seed=2))
    moved = scan[np.linalg.norm(scan[:, :2] - 4, axis=1) < 2] + np.array([0.0, 0.0, 0.3])
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF))
    grid.insert(target)
    found = grid.register(np.concatenate([scan, moved]), np.eye(4), widen=4.0)
    np.testing.assert_allclose(found.map_from_scan, true, atol=1e-3)


def test_in_a_wood_without_planes_trunks_hold_the_scan() -> None:
    true = small_pose(7, 0.004, 0.08)
    true[2, 3] = 0.0
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF))
    grid.insert(trunks(seed=1))
    found = grid.register(apply(inverse(true), trunks(seed=2)), np.eye(4), iterations=30)
    assert np.linalg.norm((found.map_from_scan - true)[:2, 3]) < 0.02
    assert found.inlier_fraction < 0.5
    assert found.score > 0.5


def test_rings_on_flat_ground_do_not_hold_a_scan_back() -> None:
    true = transform([0.03, 0.7, 0.0], [np.cos(0.004), 0, 0, np.sin(0.004)])
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF))
    grid.insert(kernels.voxel_means(rings(np.eye(4), 1), 0.1))
    scan = kernels.voxel_means(rings(true, 2), 0.5)
    for guess in (np.eye(4), transform([0.0, 1.4, 0.0], [1.0, 0, 0, 0.03])):
        found = grid.register(scan, guess, iterations=30, widen=10.0).map_from_scan
        assert np.linalg.norm((found - true)[:2, 3]) < 0.05
        assert np.degrees(Rotation.from_matrix(found[:3, :3].T @ true[:3, :3]).magnitude()) < 0.2


def test_what_is_out_of_reach_is_forgotten() -> None:
    grid = PlaneMap(PlaneSettings(leaf_m=LEAF), horizon=10)
    for k in range(64):
        grid.insert(corner(200) + np.array([0.0, 12.0 * k, 0.0]))
    assert len(grid) < 30 * len(voxels(corner(200), LEAF))
    near = grid.register(corner(200, seed=3) + np.array([0.0, 12.0 * 63, 0.0]), np.eye(4))
    far = grid.register(corner(200, seed=3), np.eye(4))
    assert near.known_fraction > 0.3 > far.known_fraction


def test_an_empty_map_says_nothing() -> None:
    found = PlaneMap(PlaneSettings()).register(corner(100), np.eye(4))
    np.testing.assert_array_equal(found.map_from_scan, np.eye(4))
    assert not found.information.any()
    assert (found.known_fraction, found.inlier_fraction, found.rms_m, found.score) == (0, 0, 0, 0)


def test_points_move_with_the_pose_of_their_own_time() -> None:
    rng = np.random.default_rng(0)
    points, times = rng.normal(0, 10, (500, 3)), np.sort(rng.uniform(0, 100, 500))
    knots = np.arange(0.0, 101.0, 5.0)
    poses = transform(np.outer(knots, [0.1, 0.2, 0.0]), np.tile([1.0, 0, 0, 0], (len(knots), 1)))
    plain = points + np.outer(times, [0.1, 0.2, 0.0])
    np.testing.assert_allclose(compensate(points, times, knots, poses), plain, atol=1e-9)
    order = rng.permutation(500)
    np.testing.assert_allclose(compensate(points[order], times[order], knots, poses), plain[order], atol=1e-9)


def test_corrections_are_those_of_the_angles_themselves() -> None:
    rng = np.random.default_rng(1)
    ring = rng.integers(0, 32, 300).astype(np.uint8)
    points = rng.normal(0, 20, (300, 3))
    points[0] = 0.0
    corrections = {
        "range_offset_m": 0.02,
        "channel_range_offset_m": rng.normal(0, 0.01, 32),
        "channel_elevation_offset_rad": rng.normal(0, 0.002, 32),
        "channel_azimuth_offset_rad": rng.normal(0, 0.002, 32),
    }
    x, y, z = points[1:].T
    channel = ring[1:]
    distance = np.linalg.norm(points[1:], axis=1) + 0.02 + corrections["channel_range_offset_m"][channel]
    elevation = np.arctan2(z, np.hypot(x, y)) + corrections["channel_elevation_offset_rad"][channel]
    azimuth = np.arctan2(x, y) + corrections["channel_azimuth_offset_rad"][channel]
    flat = np.cos(elevation)
    plain = distance[:, None] * np.stack(
        [flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(elevation)], axis=1
    )
    found = correct_points(points, ring, corrections)
    np.testing.assert_allclose(found[1:], plain, atol=1e-9)
    np.testing.assert_array_equal(found[0], 0)
