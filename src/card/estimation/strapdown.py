"""Strapdown integration: where the IMU alone says the rig went from a known state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.estimation.imu import Imu

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Path:
    """States in a fixed frame at t_ns (N,): rotation (N, 3, 3), position (N, 3) m, velocity (N, 3) m/s."""

    t_ns: NDArray[np.int64]
    rotation: Array
    position: Array
    velocity: Array

    @property
    def pose(self) -> Array:
        """Transforms (N, 4, 4)."""
        pose = np.tile(np.eye(4), (len(self.t_ns), 1, 1))
        pose[:, :3, :3], pose[:, :3, 3] = self.rotation, self.position
        return pose

    def backwards(self) -> "Path":
        """The states from the last to the first."""
        return Path(self.t_ns[::-1], self.rotation[::-1], self.position[::-1], self.velocity[::-1])


def integrate(imu: Imu, pose: Array, velocity: Array, gravity: Array) -> Path:
    """Integrate samples (N,), free of bias, from a pose (4, 4) and velocity (3,) at the first one.

    gravity : (3,) m/s^2 in the fixed frame, pointing down. Both rate and specific force are taken as linear
    between samples, whose times may also fall; the force is turned with the attitude in the middle of each
    step, to second order (P. Savage, "Strapdown Inertial Navigation Integration Algorithm Design", 1998).
    """
    seconds = np.diff(imu.t_ns) * 1e-9
    turns = exp_so3(0.5 * (imu.gyro[1:] + imu.gyro[:-1]) * seconds[:, None])
    halves = exp_so3(0.25 * (imu.gyro[1:] + imu.gyro[:-1]) * seconds[:, None])
    force = np.einsum("nij,nj->ni", halves, 0.5 * (imu.accel[1:] + imu.accel[:-1]))
    rotation = np.empty((len(imu.t_ns), 3, 3))
    rotation[0] = pose[:3, :3]
    for k, turn in enumerate(turns):
        rotation[k + 1] = rotation[k] @ turn
    acceleration = np.einsum("nij,nj->ni", rotation[:-1], force) + gravity
    steps = acceleration * seconds[:, None]
    speed = np.concatenate([velocity[None], velocity + np.cumsum(steps, axis=0)])
    moves = (speed[:-1] + 0.5 * steps) * seconds[:, None]
    position = np.concatenate([pose[None, :3, 3], pose[:3, 3] + np.cumsum(moves, axis=0)])
    return Path(imu.t_ns, rotation, position, speed)


def exp_so3(vector: Array) -> Array:
    """Rotation matrices (N, 3, 3) of rotation vectors (N, 3), Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0, np.sin(safe) / safe)
    b = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    x, y, z = vector.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.asarray(np.eye(3) + a * cross + b * (cross @ cross))
