"""The state in which a drive begins, at rest or in motion."""

import numpy as np
from numpy.typing import NDArray

from card.estimation.imu import Imu
from card.estimation.smoother import StartSigmas, State
from card.estimation.strapdown import integrate
from card.geometry import Trajectory, transform

Array = NDArray[np.float64]
#: How well a second of scans and IMU tells velocity (m/s) and the direction of gravity (rad).
SIGMAS = StartSigmas(velocity=0.2, gravity=0.03)


def start_state(imu: Imu, path: Trajectory, gravity_m_s2: float) -> State:
    """The state at the first pose of a path from scans alone over about a second, z up along gravity.

    What the IMU leads to without gravity and initial velocity falls short of the path by v t + g t^2 / 2,
    linear in both. The biases are taken as zero: what they add lies within SIGMAS.
    """
    samples = imu.between(path.start_ns, path.end_ns)
    blind = integrate(samples, np.eye(4), np.zeros(3), np.zeros(3))
    seconds = (path.t_ns - path.start_ns) * 1e-9
    known = (samples.t_ns - path.start_ns) * 1e-9
    # Their rotations agree but for the frame: both start as identity.
    there = np.stack([np.interp(seconds, known, blind.position[:, axis]) for axis in range(3)], axis=1)
    short = path.translation_m - path.translation_m[0] - there
    design = np.stack([seconds, 0.5 * seconds**2], axis=1)
    # Gravity's size is known: a weak row keeps two or three poses solvable.
    weak = np.array([[0.0, 1e-2]])
    mean_force = blind.velocity[-1] / max(seconds[-1], 1e-3)
    velocity, gravity = np.linalg.lstsq(
        np.vstack([design, weak]), np.vstack([short, -1e-2 * mean_force[None]]), rcond=None
    )[0]
    up = -gravity / np.linalg.norm(gravity)
    level = _upright(up)
    return State(
        path.start_ns,
        level,
        level[:3, :3] @ velocity,
        np.zeros(3),
        np.zeros(3),
        np.array([0.0, 0.0, -gravity_m_s2]),
    )


def _upright(up: Array) -> Array:
    """The rotation (4, 4) about a level axis that turns a direction of up (3,) in rig to z."""
    axis = np.cross(up, [0.0, 0.0, 1.0])
    quaternion = np.concatenate([[1.0 + up[2]], axis])
    if np.linalg.norm(quaternion) < 1e-6:
        quaternion = np.array([0.0, 1.0, 0.0, 0.0])
    return transform(np.zeros(3), quaternion)
