"""What a wheel stands on: the mean of the surface over the tyre's footprint."""

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, apply
from card.simulation.road import Road

Array = NDArray[np.float64]

#: Contact patch along and across the tyre, m, and samples each way.
FOOTPRINT_M = (0.24, 0.20)
SAMPLES = (6, 5)


def footprint_height(road: Road, xy: Array, forward: Array, guess: Array) -> Array:
    """Mean height (N,) in world under tyres at xy (N, 2) heading along ``forward`` (N, 2), near arc lengths.

    The patch stays flat to the road's coordinates: over 12 cm a bend does not show.
    """
    s, d = road.coordinates(xy, guess)
    heading = forward @ road.world_from_map[:2, :2]
    tangent, bend = road.line.at(s, 1), road.line.at(s, 2)
    right = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    stretch = 1 - d * np.sum(bend * right, axis=1)
    cos, sin = np.sum(heading * tangent, axis=1), np.sum(heading * right, axis=1)
    total = np.zeros(len(xy))
    for a in _midpoints(FOOTPRINT_M[0], SAMPLES[0]):
        for b in _midpoints(FOOTPRINT_M[1], SAMPLES[1]):
            total += road.xyz(s + (a * cos - b * sin) / stretch, d + a * sin + b * cos)[..., 2]
    return total / (SAMPLES[0] * SAMPLES[1])


def wheel_contacts(road: Road, trajectory: Trajectory, contact: Array, guess: Array) -> Array:
    """World points (N, 3) where one wheel touches at the trajectory's poses: the truth of wheel excitation.

    The contact point ``contact`` (3,) of the rig at rest slides along the rig's z to that surface.
    """
    world_from_rig = trajectory.at(trajectory.t_ns)
    up = world_from_rig[:, :3, 2]
    forward = world_from_rig[:, :2, 1] / np.linalg.norm(world_from_rig[:, :2, 1], axis=1, keepdims=True)
    point = apply(world_from_rig, np.broadcast_to(contact, (len(up), 3)))
    for _ in range(2):
        gap = footprint_height(road, point[:, :2], forward, guess + contact[1]) - point[:, 2]
        point = point + (gap / up[:, 2])[:, None] * up
    return point


def _midpoints(length: float, count: int) -> Array:
    return ((np.arange(count) + 0.5) / count - 0.5) * length
