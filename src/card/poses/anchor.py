"""From the frames of a delivered trajectory to ``world`` and ``rig``."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def up_vector(axis: str) -> Array:
    """The unit vector (3,) of an axis written as ``x``, ``-y``, ``z`` ..."""
    vector = np.zeros(3)
    vector["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return vector


def anchor(delivered_from_rig: Array, up: Array) -> Array:
    """Poses world_from_rig (N, 4, 4) of poses in the frame of the delivered trajectory (N, 4, 4).

    The origin moves to the first rig pose, the delivered up (3,) becomes Z, and the first pose's forward
    axis, laid flat, becomes Y (design, "Words and conventions"). Roll and pitch stay as delivered.
    """
    first = delivered_from_rig[0]
    forward = first[:3, 1] - up * (up @ first[:3, 1])
    forward = forward / np.linalg.norm(forward)
    world_from_delivered = np.eye(4)
    world_from_delivered[:3, :3] = np.stack([np.cross(forward, up), forward, up])
    world_from_delivered[:3, 3] = -world_from_delivered[:3, :3] @ first[:3, 3]
    return world_from_delivered @ delivered_from_rig


def tilt_deg(a_from_rig: Array, up: Array) -> Array:
    """Angle (N,) in degrees between the rig's z and an up (3,) in frame ``a``, for poses (N, 4, 4)."""
    return np.degrees(np.arccos(np.clip(a_from_rig[:, :3, 2] @ up, -1.0, 1.0)))
