"""What a wheel stands on: the mean of the surface over the tyre's footprint."""

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, apply
from card.simulation.road import Road

Array = NDArray[np.float64]

#: Contact patch along and across the tyre, m.
FOOTPRINT_M = (0.24, 0.20)
#: Gauss points each way on the bare road (exact to micrometres), midpoints on what interrupts it.
GAUSS_POINTS, MIDPOINTS = 3, (24, 20)


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
    point, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    for a, share_a in zip(FOOTPRINT_M[0] / 2 * point, weight / 2, strict=True):
        for b, share_b in zip(FOOTPRINT_M[1] / 2 * point, weight / 2, strict=True):
            along, across = s + (a * cos - b * sin) / stretch, d + a * sin + b * cos
            total += share_a * share_b * road.bare(along, across)[..., 2]
    reach = np.hypot(*FOOTPRINT_M) / 2
    a, b = (_midpoints(length, count) for length, count in zip(FOOTPRINT_M, MIDPOINTS, strict=True))
    a, b = (v.ravel() for v in np.meshgrid(a, b, indexing="ij"))
    for thing in road.irregularities:
        local = road.near(s, thing)
        s_min, s_max, d_min, d_max = thing.extent
        near = (local > s_min - reach) & (local < s_max + reach) & (d > d_min - reach) & (d < d_max + reach)
        if near.any():
            c, si = cos[near, None], sin[near, None]
            along = local[near, None] + (a * c - b * si) / stretch[near, None]
            within = (along > s_min) & (along < s_max)
            heights = np.where(within, thing.height(along, d[near, None] + a * si + b * c), 0.0)
            total[near] += heights.mean(axis=1)
    return total


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
