"""Distance along a contact path and height over it, for points near the path."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from card.wheels import corridor_kernels
from card.wheels.contact_path import ContactPath

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corridor:
    """How far from the path a point may lie, metres: sideways, in height and beyond the end of a run."""

    half_width_m: float
    max_height_m: float
    overhang_m: float = 0.0


def project(
    points: Array, position: Array, rotation: Array, arc: Array, nearest: NDArray[np.int64] | None = None
) -> tuple[Array, Array, Array]:
    """Arc length d_p, height h_p and sideways offset of points, each (P,), in metres.

    points : (P, 3) world. position, rotation, arc : (M, 3), (M, 3, 3), (M,) poses of the path, M >= 2.
    nearest : (P,) index of the pose nearest to each point, if it is known.

    Supplement, "Wheel Excitation": alpha, d_p and h_p between the two closest adjacent poses; the offset is
    the x component where h_p is the z component.
    """
    if nearest is None:
        _, nearest = cKDTree(position).query(points)
    before, after = np.maximum(nearest - 1, 0), np.minimum(nearest + 1, len(position) - 1)
    to_before, to_after = points - position[before], points - position[after]
    nearer_before = np.sqrt(_dot(to_before, to_before)) < np.sqrt(_dot(to_after, to_after))
    # At an end one neighbour is the nearest pose itself: take the other.
    back = (nearest == len(position) - 1) | ((nearest > 0) & nearer_before)
    i = np.where(back, nearest, nearest + 1)
    step = position[i] - position[i - 1]
    from_start, from_end = points - position[i - 1], points - position[i]
    alpha = _dot(step, from_start) / _dot(step, step)
    d = (1 - alpha) * arc[i - 1] + alpha * arc[i]
    start, end = rotation[i - 1], rotation[i]
    h, sideways = (
        (1 - alpha) * _dot(start[..., axis], from_start) + alpha * _dot(end[..., axis], from_end)
        for axis in (2, 0)
    )
    return d, h, sideways


def _dot(a: Array, b: Array) -> Array:
    """Scalar products (P,) of vectors (P, 3), summed up in the order of their components."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


@dataclass(frozen=True)
class RoadPoints:
    """Points in a wheel's corridor: arc length, offset to the right and height over the path, (Q,) metres.

    run : (Q,) the run of the path that each point was taken for.
    """

    arc: Array
    sideways: Array
    height: Array
    run: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.arc)

    def part(self, chosen: Any) -> "RoadPoints":
        """The points that an index or a mask (Q,) chooses."""
        return RoadPoints(self.arc[chosen], self.sideways[chosen], self.height[chosen], self.run[chosen])

    @classmethod
    def joined(cls, pieces: Sequence["RoadPoints"]) -> "RoadPoints":
        """All points of the pieces, in their order."""
        if not pieces:
            return cls(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64))
        if len(pieces) == 1:
            return pieces[0]
        columns = ([getattr(piece, name) for piece in pieces] for name in cls.__dataclass_fields__)
        return cls(*map(np.concatenate, columns))


def corridor_points(
    points: Array,
    path: ContactPath,
    window: tuple[float, float],
    corridor: Corridor,
    compiled: bool = True,
) -> tuple[RoadPoints, NDArray[np.int64]]:
    """The points (P, 3) in world that lie in the corridor of one pass, and which they are (Q,).

    The pass is the piece of path with arc lengths in `window`, so that a street driven twice keeps its two
    passes apart. Runs forward and in reverse over the same ground each take the points. compiled : whether
    they are found in machine code; the plain form gives the same bits.
    """
    found, which = [], []
    take = corridor_kernels.corridor if compiled else _corridor
    for run, first, last in _runs(path, window):
        piece = slice(first, last + 1)
        poses = path.knot_position[piece], path.knot_rotation[piece], path.knot_arc[piece]
        # The footprint of a wheel that stands at the end of a run reaches beyond it.
        low, high = path.ends(run)
        ends = (
            float(max(low - corridor.overhang_m, window[0])),
            float(min(high + corridor.overhang_m, window[1])),
        )
        sides = corridor.half_width_m, corridor.max_height_m
        (d, h, sideways), chosen = take(points, *poses, _reach(poses[2], corridor), *sides, ends)
        found.append(RoadPoints(d, sideways, h, np.full(len(d), run)))
        which.append(chosen)
    return RoadPoints.joined(found), np.concatenate(which or [np.zeros(0, dtype=np.int64)])


def _corridor(
    points: Array,
    position: Array,
    rotation: Array,
    arc: Array,
    reach_m: float,
    half_width_m: float,
    max_height_m: float,
    window: tuple[float, float],
) -> tuple[Array, NDArray[np.int64]]:
    """See `corridor_kernels.corridor`."""
    distance, nearest = cKDTree(position).query(points, distance_upper_bound=reach_m)
    near = np.flatnonzero(np.isfinite(distance))
    d, h, sideways = project(points[near], position, rotation, arc, nearest[near])
    inside = (np.abs(sideways) <= half_width_m) & (np.abs(h) <= max_height_m)
    inside &= (d >= window[0]) & (d <= window[1])
    return np.stack([d, h, sideways])[:, inside], near[inside]


def _reach(arc: Array, corridor: Corridor) -> float:
    """How far from the nearest of the poses at arc lengths (M,) a point of the corridor can be, metres."""
    step = float((arc[1:] - arc[:-1]).max())
    return math.hypot(corridor.half_width_m, corridor.max_height_m) + corridor.overhang_m + step


def _runs(path: ContactPath, window: tuple[float, float]) -> Iterator[tuple[int, int, int]]:
    """Each run of segments that touches the window, with its first and last knot in there."""
    first = max(int(path.knot_arc.searchsorted(window[0], side="left")) - 1, 0)
    last = int(path.knot_arc.searchsorted(window[1], side="right"))
    # Runs are numbered along the path.
    runs = path.run[first:last]
    for run in range(int(runs[0]), int(runs[-1]) + 1) if len(runs) else ():
        yield run, first + int(runs.searchsorted(run)), first + int(runs.searchsorted(run, side="right"))
