"""The wheels of the car from several surveys: the mean of its poses on SE(3), and of its shape."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.calibration.corner_residuals import skew
from card.calibration.front_sensors import CAMERA_PARAMETERS, FrontSensors
from card.calibration.state import moved, step_between
from card.calibration.survey_alignment import Alignment
from card.geometry import apply
from card.geometry.rigid_alignment import align

Array = NDArray[np.float64]

_ROUNDS = 20


@dataclass(frozen=True)
class Wheels:
    """Wheel points in the left camera.

    points_m : (8, 3) in the order of `survey_points.WHEEL_POINTS`.
    covariance : (24, 24) of them by corners and surveys.
    by_cameras : (24, 24) how they move with the cameras' parameters.
    each_m : (K, 8, 3) as each survey alone has them.
    """

    points_m: Array
    covariance: Array
    by_cameras: Array
    each_m: Array

    def in_camera(self, sensors: FrontSensors) -> tuple[Array, Array]:
        """Points (8, 3) in the left camera and their whole covariance (24, 24)."""
        known = sensors.covariance[:CAMERA_PARAMETERS, :CAMERA_PARAMETERS]
        return self.points_m, self.covariance + self.by_cameras @ known @ self.by_cameras.T

    def in_lidar(self, sensors: FrontSensors) -> tuple[Array, Array]:
        """The same in the front LiDAR: what is wrong with the cameras is partly undone on the way there."""
        turned = self.points_m @ sensors.lidar_from_left[:3, :3].T
        turn = np.kron(np.eye(len(turned)), sensors.lidar_from_left[:3, :3])
        by_all = np.concatenate([turn @ self.by_cameras, by_pose(turned)], axis=1)
        return (
            apply(sensors.lidar_from_left, self.points_m),
            turn @ self.covariance @ turn.T + by_all @ sensors.covariance @ by_all.T,
        )


def mean_wheels(alignments: Sequence[Alignment], wheels: Array, survey_sigma_m: float) -> Wheels:
    """The mean over surveys.

    The wheels of all surveys have one shape, that of the standing car: its mean defines a frame, and each
    survey gives a pose of that frame in the left camera. Their mean, weighted by information, is where the
    residual steps of all of them cancel (X. Pennec, "Intrinsic Statistics on Riemannian Manifolds", 2006).
    What is wrong with the cameras is common to all surveys and does not cancel.

    wheels : (K, 8, 3) in the frames of the stations.
    """
    shape = mean_shape(wheels)
    each = np.stack(
        [apply(a.left_from_station, points) for a, points in zip(alignments, wheels, strict=True)]
    )
    poses = [align(points, shape) for points in each]
    information, by_cameras = [], []
    for alignment, pose in zip(alignments, poses, strict=True):
        carried = np.eye(6)
        carried[:3, 3:] = -skew(pose[:3, 3] - alignment.left_from_station[:3, 3])
        points = by_pose(shape @ pose[:3, :3].T)
        # The survey's noise turns and shifts the set of wheel points itself, too.
        noise = survey_sigma_m**2 * np.linalg.inv(points.T @ points)
        information.append(np.linalg.inv(carried @ alignment.covariance @ carried.T + noise))
        by_cameras.append(carried @ alignment.by_cameras)
    mean, covariance = _mean_pose(poses, information)
    common = covariance @ np.sum([i @ b for i, b in zip(information, by_cameras, strict=True)], axis=0)
    points = by_pose(shape @ mean[:3, :3].T)
    unrigid = np.eye(len(points)) - points @ np.linalg.pinv(points)
    return Wheels(
        apply(mean, shape),
        points @ covariance @ points.T + unrigid * survey_sigma_m**2 / len(wheels),
        points @ common,
        each,
    )


def mean_shape(sets: Array) -> Array:
    """Mean (N, 3) of sets of points (K, N, 3) that differ by a rigid transform and noise; its middle is zero.

    Generalised Procrustes analysis without scale (J. C. Gower, Psychometrika 40, 1975).
    """
    shape: Array = sets[0] - sets[0].mean(axis=0)
    for _ in range(_ROUNDS):
        shape = np.mean([apply(align(shape, points), points) for points in sets], axis=0)
    return shape - shape.mean(axis=0)


def by_pose(turned: Array) -> Array:
    """Derivatives (3 N, 6) of points by a step of their pose; turned : (N, 3) less its position."""
    rows = np.concatenate([np.broadcast_to(np.eye(3), (len(turned), 3, 3)), -skew(turned)], axis=-1)
    return rows.reshape(-1, 6)


def _mean_pose(poses: Sequence[Array], information: Sequence[Array]) -> tuple[Array, Array]:
    mean = poses[0]
    covariance: Array = np.linalg.inv(np.sum(information, axis=0))
    for _ in range(_ROUNDS):
        pull = sum(i @ step_between(mean, pose) for i, pose in zip(information, poses, strict=True))
        mean = moved(mean, covariance @ pull)
    return mean, covariance
