"""Where a session's drive begins: its odometry, upright, and about where the rear LiDAR is."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.calibration.drive.rays import HeldSweeps, Rays
from card.calibration.drive.state import State
from card.errors import CardError
from card.estimation.batch import Nodes
from card.estimation.dense import dense_trajectory
from card.estimation.imu import Imu
from card.estimation.odometry import plane_settings, run_odometry
from card.estimation.plane_kernels import voxel_means
from card.estimation.plane_map import PlaneMap
from card.estimation.strapdown import Path
from card.geometry import Trajectory, apply, inverse
from card.recording.paths import LIDARS

Array = NDArray[np.float64]
FRONT, REAR = range(len(LIDARS))
#: The drawing may be off by decimetres: a kernel so many times wider takes such a guess.
WIDEN = 10.0


@dataclass(frozen=True)
class Alone:
    """Sweeps of the rear LiDAR on their own: rig_from_lidar (4, 4), and sweeps that were registered."""

    rig_from_lidar: Array
    registered: int


def first_state(
    rays: Rays, imu: Imu, mounted: Array, corrections: Array, settings: Mapping[str, Any], knot_s: float
) -> State:
    """The state that the odometry of the front LiDAR leads to, with knots at times of IMU samples.

    mounted (2, 4, 4), corrections (2, CORRECTIONS) : as believed so far.  settings : those of the odometry.
    """
    nodes = _odometry(rays, imu, mounted, settings)
    dense = dense_trajectory(nodes, imu, 0.0)
    inside = imu.t_ns[(imu.t_ns >= nodes.t_ns[0]) & (imu.t_ns <= nodes.t_ns[-1])]
    seconds = (inside[-1] - inside[0]) * 1e-9
    picked = np.linspace(0, len(inside) - 1, max(2, round(seconds / knot_s) + 1)).round().astype(int)
    t_ns = inside[picked]

    def at_knots(values: Array) -> Array:
        known, wanted = (nodes.t_ns - t_ns[0]) * 1e-9, (t_ns - t_ns[0]) * 1e-9
        return np.stack([np.interp(wanted, known, values[:, axis]) for axis in range(3)], axis=1)

    return State(
        t_ns,
        dense.at(t_ns),
        at_knots(nodes.velocities),
        at_knots(nodes.gyro_biases),
        at_knots(nodes.accel_biases),
        mounted.copy(),
        corrections.copy(),
    )


def rear_alone(
    rays: Rays, state: State, trajectory: Trajectory, settings: Mapping[str, Any], count: int
) -> Alone:
    """The rear LiDAR's mounting by which single sweeps of it fit the map of the front one, in the median.

    settings : those of the odometry.  count : sweeps that are tried.

    Raises
    ------
    CardError
        If none can be registered.
    """
    points = rays.corrected(state.documents())
    grid = PlaneMap(plane_settings(settings))
    for scan in _scans(rays, points, FRONT, state, trajectory):
        grid.insert(apply(scan[1], voxel_means(scan[0], settings["map_points_leaf_m"])))
    rear = list(_scans(rays, points, REAR, state, trajectory))
    found = []
    for k in np.unique(np.linspace(0, len(rear) - 1, count).round().astype(int)) if rear else []:
        in_rig, pose = rear[k]
        place = grid.register(voxel_means(in_rig, settings["scan_leaf_m"]), pose, iterations=30, widen=WIDEN)
        if place.inlier_fraction >= settings["min_inlier_fraction"]:
            found.append(inverse(pose) @ place.map_from_scan @ state.mounted[REAR])
    if not found:
        raise CardError(
            "no sweep of lidar_rear fits the map of lidar_front",
            wanted="the rear LiDAR about where it is drawn",
        )
    poses = np.stack(found)
    middle = poses[0]
    turned = Rotation.from_matrix(middle[:3, :3].T @ poses[:, :3, :3]).as_rotvec()
    result = middle.copy()
    result[:3, :3] = middle[:3, :3] @ Rotation.from_rotvec(np.median(turned, axis=0)).as_matrix()
    result[:3, 3] = np.median(poses[:, :3, 3], axis=0)
    return Alone(result, len(found))


def _odometry(rays: Rays, imu: Imu, mounted: Array, settings: Mapping[str, Any]) -> Nodes:
    """The odometry's states in a frame whose z is up."""
    steps = run_odometry(HeldSweeps(rays, FRONT, rays.points, mounted[FRONT]), imu, settings)
    states = [step.state for step in steps]
    gravity = states[-1].gravity
    down = np.array([0.0, 0.0, -1.0])
    turn, _ = Rotation.align_vectors(down[None], gravity[None] / np.linalg.norm(gravity))
    upright = np.eye(4)
    upright[:3, :3] = turn.as_matrix()
    return Nodes(
        np.array([state.t_ns for state in states], dtype=np.int64),
        upright @ np.stack([state.pose for state in states]),
        turn.apply(np.stack([state.velocity for state in states])),
        np.stack([state.gyro_bias for state in states]),
        np.stack([state.accel_bias for state in states]),
        down * settings["gravity_m_s2"],
    )


def _scans(
    rays: Rays, points: Array, lidar: int, state: State, trajectory: Trajectory
) -> list[tuple[Array, Array]]:
    """Sweeps within the trajectory: points in the rig at their ends, and world_from_rig there."""
    held, result = HeldSweeps(rays, lidar, points, state.mounted[lidar]), []
    t_ns = trajectory.t_ns
    for i in range(len(held)):
        start, end = int(held.start_ns[i]), int(held.end_ns[i])
        if start < t_ns[0] or end > t_ns[-1]:
            continue
        knots = np.concatenate([[start], t_ns[(t_ns > start) & (t_ns < end)], [end]])
        pose = trajectory.at(knots)
        path = Path(knots, pose[:, :3, :3], pose[:, :3, 3], np.zeros((len(knots), 3)))
        result.append((held[i].at_end(path), pose[-1]))
    return result
