"""The path of a wheel's contact point if the wheel were rigidly fixed to the rig."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.geometry import Trajectory, apply, matrix_from_quaternion, transform
from card.wheels import path_kernels

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
#: A contact that goes back less than this is that of a body nodding over standing wheels.
MIN_RUN_M = 0.3


@dataclass(frozen=True)
class ContactPath:
    """A rigid contact path and the poses of it that carry arc length (supplement, "Wheel Excitation").

    t_ns, position, rotation : all N trajectory times (N,), contact points in world (N, 3) in metres,
        rotations world_from_rig (N, 3, 3).
    knots : (M,) indices of the poses that are at least one step apart; a standing car adds none.
    knot_arc : (M,) cumulative length d_i of the polyline through them, metres.
    arc : (N,) arc length of every pose, by projection on the segment it lies on; less than a step beyond an
        end of a run it goes on.
    segment : (N,) number of the segment each pose lies on; segment i joins knots i and i + 1.
    run : (M - 1,) number of the run each segment belongs to: it grows where driving turns to reverse or back.
    """

    t_ns: Indices
    position: Array
    rotation: Array
    knots: Indices
    knot_arc: Array
    arc: Array
    segment: Indices
    run: Indices

    @cached_property
    def knot_position(self) -> Array:
        """Contact points (M, 3) of the knots, metres in world."""
        return self.position[self.knots]

    @cached_property
    def knot_rotation(self) -> Array:
        """Rotations world_from_rig (M, 3, 3) of the knots."""
        return self.rotation[self.knots]

    def arc_at(self, t_ns: ArrayLike) -> Array:
        """Arc lengths (...) in metres at times (...) in nanoseconds."""
        # Differences first: nanoseconds since 1970 do not fit a float64.
        since = np.asarray(t_ns, dtype=np.int64) - self.t_ns[0]
        return np.interp(since, self._since, self.arc)

    @cached_property
    def _since(self) -> Indices:
        return self.t_ns - self.t_ns[0]

    def ends(self, run: int) -> tuple[float, float]:
        """Arc lengths at which a run begins and ends, metres."""
        first, last = self._knots(run)
        return float(self.knot_arc[first]), float(self.knot_arc[last])

    def elevation(self, arc: ArrayLike, run: int) -> Array:
        """World z (...) in metres of a run of the path at arc lengths (...), straight on beyond its ends."""
        first, last = self._knots(run)
        d, z = np.asarray(arc, dtype=np.float64), self.knot_position[:, 2]
        i = np.clip(np.searchsorted(self.knot_arc, d, side="right"), first + 1, last)
        alpha = (d - self.knot_arc[i - 1]) / (self.knot_arc[i] - self.knot_arc[i - 1])
        return (1 - alpha) * z[i - 1] + alpha * z[i]

    def _knots(self, run: int) -> tuple[int, int]:
        # Runs are numbered along the path.
        return int(self.run.searchsorted(run)), int(self.run.searchsorted(run, side="right"))

    def surface(self, arc: ArrayLike, height: ArrayLike) -> Array:
        """Points (..., 3) in world at arc lengths (...) and heights (...) over the path, both metres.

        The inverse of `arc_height.project`: blends the two poses around each arc length.
        """
        d, h = np.asarray(arc, dtype=np.float64), np.asarray(height, dtype=np.float64)
        raised = np.broadcast_to(h[..., None], (*d.shape, 1))
        if len(self.knots) == 1:
            return self.knot_position[0] + raised * self.knot_rotation[0, :, 2]
        i = np.clip(np.searchsorted(self.knot_arc, d, side="right"), 1, len(self.knots) - 1)
        before, after = self.knot_arc[i - 1], self.knot_arc[i]
        alpha = ((d - before) / (after - before))[..., None]
        low = self.knot_position[i - 1] + raised * self.knot_rotation[i - 1, :, 2]
        high = self.knot_position[i] + raised * self.knot_rotation[i, :, 2]
        return (1 - alpha) * low + alpha * high


def contact_path(trajectory: Trajectory, contact_rig: ArrayLike, min_step_m: float) -> ContactPath:
    """The path of a contact point (3,), metres in rig, along a trajectory; steps shorter are dropped."""
    world_from_rig = transform(trajectory.translation_m, trajectory.rotation_wxyz)
    points = np.broadcast_to(np.asarray(contact_rig, dtype=np.float64), (len(trajectory.t_ns), 3))
    position = apply(world_from_rig, points)
    rotation = matrix_from_quaternion(trajectory.rotation_wxyz)
    knots = path_kernels.knots(position, min_step_m)
    steps = np.diff(position[knots], axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    knot_arc = np.concatenate([[0.0], np.cumsum(lengths)])
    forward = np.einsum("ij,ij->i", steps, rotation[knots[:-1], :, 1]) >= 0
    run = _runs(forward, lengths)
    segment = np.searchsorted(knots, np.arange(len(position)), side="right") - 1
    segment = np.clip(segment, 0, max(len(knots) - 2, 0))
    arc = _arc(position, knots, knot_arc, segment, run)
    return ContactPath(trajectory.t_ns, position, rotation, knots, knot_arc, arc, segment, run)


def _arc(position: Array, knots: Indices, knot_arc: Array, segment: Indices, run: Indices) -> Array:
    if len(knots) == 1:
        return np.zeros(len(position))
    start = position[knots[segment]]
    step = position[knots[segment + 1]] - start
    alpha = np.einsum("ij,ij->i", step, position - start) / np.einsum("ij,ij->i", step, step)
    turns = np.concatenate([[True], run[1:] != run[:-1], [True]])
    low, high = np.where(turns[segment], -1.0, 0.0), np.where(turns[segment + 1], 2.0, 1.0)
    return knot_arc[segment] + np.clip(alpha, low, high) * (knot_arc[segment + 1] - knot_arc[segment])


def _runs(forward: NDArray[np.bool_], lengths: Array) -> Indices:
    """Run numbers (S,) of segments: a new one wherever the direction changes for long enough."""
    if len(forward) == 0:
        return np.zeros(0, dtype=np.int64)
    starts = np.concatenate([[0], np.flatnonzero(forward[1:] != forward[:-1]) + 1])
    long_enough = np.add.reduceat(lengths, starts) >= MIN_RUN_M
    direction, turns = None, []
    for start in starts[long_enough].tolist():
        if direction is not None and forward[start] != direction:
            turns.append(start)
        direction = forward[start]
    return np.searchsorted(turns, np.arange(len(forward)), side="right").astype(np.int64)
