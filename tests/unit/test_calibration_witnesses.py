"""Rear LiDAR and IMU by other people's registration and a closed form, beside the estimate of the stage."""

from itertools import pairwise

import numpy as np
import pytest
import small_gicp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from session_yard import Yard, path_of, yard
from test_calibration_consistency import estimate

from card.artifacts import default_settings
from card.calibration.drive.rays import HeldSweeps
from card.calibration.drive.state import State
from card.estimation.lidar_only import scan_trajectory
from card.estimation.odometry import plane_settings
from card.geometry import apply, inverse

Array = NDArray[np.float64]
SEED, SECONDS = 7, 6.0


@pytest.fixture(scope="module")
def scene() -> Yard:
    return yard(SEED, seconds=SECONDS, columns=60)


@pytest.fixture(scope="module")
def found() -> State:
    return estimate(SEED, columns=60)[0].state


def test_registering_single_sweeps_finds_the_rear_lidar(scene: Yard, found: State) -> None:
    """Point-to-plane ICP of small_gicp, along the true path and with true corrections."""
    path, rays, truth = path_of(SECONDS, lively=True), scene.rays, scene.truth
    points = rays.corrected(truth.documents())
    placed = np.empty_like(points)
    for lidar in range(2):
        mine = rays.lidar == lidar
        placed[mine] = apply(path.at(rays.time_ns[mine]) @ truth.mounted[lidar], points[mine])
    front, _ = small_gicp.preprocess_points(placed[rays.lidar == 0], downsampling_resolution=0.1)
    tree = small_gicp.KdTree(front)
    poses = []
    for sweep in rays.sweeps_of(1)[::6]:
        mine = slice(rays.first[sweep], rays.first[sweep + 1])
        pose = path.at(int(rays.end_ns[sweep]))
        # As the LiDAR would have seen it from where it was at the end.
        seen = apply(inverse(pose @ truth.mounted[1]), placed[mine])
        source, _ = small_gicp.preprocess_points(seen, downsampling_resolution=0.1)
        guess = pose @ scene.drawn[1]
        result = small_gicp.align(front, source, tree, guess, "PLANE_ICP", max_correspondence_distance=0.5)
        poses.append(inverse(pose @ truth.mounted[0]) @ result.T_target_source)
    theirs = np.stack(poses)
    ours = inverse(found.mounted[0]) @ found.mounted[1]
    turn = Rotation.from_matrix(ours[:3, :3].T @ theirs[:, :3, :3]).as_rotvec()
    assert np.degrees(np.abs(np.median(turn, axis=0))).max() < 0.05
    assert np.abs(np.median(theirs[:, :3, 3], axis=0) - ours[:3, 3]).max() < 0.005


def test_rotations_alone_find_the_imu(scene: Yard, found: State) -> None:
    """B. Horn's closed form on turns by gyro and by scans, of which neither knows of the other."""
    held = HeldSweeps(scene.rays, 0, scene.rays.corrected(scene.truth.documents()), np.eye(4))
    settings = default_settings("odometry")
    _, path = scan_trajectory(
        [held[i] for i in range(len(held))], settings["scan_leaf_m"], plane_settings(settings)
    )
    edges = path.t_ns[::4]
    pose = path.at(edges)[:, :3, :3]
    by_scans = Rotation.from_matrix(np.swapaxes(pose[:-1], 1, 2) @ pose[1:]).as_rotvec()
    gyro = []
    for start, end in pairwise(edges):
        part = scene.imu.between(int(start), int(end))
        turned = Rotation.identity()
        for rate, dt in zip(0.5 * (part.gyro[1:] + part.gyro[:-1]), np.diff(part.t_ns) * 1e-9, strict=True):
            turned = turned * Rotation.from_rotvec(rate * dt)
        gyro.append(turned.as_rotvec())
    rig_from_lidar, _ = Rotation.align_vectors(np.stack(gyro), by_scans)
    off = rig_from_lidar.inv() * Rotation.from_matrix(found.mounted[0, :3, :3])
    assert np.degrees(off.magnitude()) < 0.5
