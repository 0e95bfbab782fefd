"""Distance along a contact path and height over it, for points near the path."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from card.wheels.contact_path import ContactPath
from card.wheels.corridor_kernels import nearest_poses

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
    distance_before = np.linalg.norm(points - position[before], axis=1)
    distance_after = np.linalg.norm(points - position[after], axis=1)
    # At an end one neighbour is the nearest pose itself: take the other.
    back = (nearest == len(position) - 1) | ((nearest > 0) & (distance_before < distance_after))
    i = np.where(back, nearest, nearest + 1)
    step = position[i] - position[i - 1]
    from_start, from_end = points - position[i - 1], points - position[i]
    alpha = np.einsum("pj,pj->p", step, from_start) / np.einsum("pj,pj->p", step, step)
    d = (1 - alpha) * arc[i - 1] + alpha * arc[i]
    local = (1 - alpha)[:, None] * np.einsum("pji,pj->pi", rotation[i - 1], from_start)
    local += alpha[:, None] * np.einsum("pji,pj->pi", rotation[i], from_end)
    return d, local[:, 2], local[:, 0]


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
    nearest poses are found in machine code; the plain form gives the same points.
    """
    found, which = [RoadPoints.joined([])], [np.zeros(0, dtype=np.int64)]
    for run, first, last in _runs(path, window):
        piece = slice(first, last + 1)
        arc, position = path.knot_arc[piece], path.knot_position[piece]
        reach = _reach(position, corridor)
        nearest = nearest_poses(points, position, reach) if compiled else _nearest(points, position, reach)
        near = np.flatnonzero(nearest >= 0)
        d, h, sideways = project(points[near], position, path.knot_rotation[piece], arc, nearest[near])
        inside = (np.abs(sideways) <= corridor.half_width_m) & (np.abs(h) <= corridor.max_height_m)
        # The footprint of a wheel that stands at the end of a run reaches beyond it.
        low, high = path.ends(run)
        inside &= (d >= max(low - corridor.overhang_m, window[0])) & (
            d <= min(high + corridor.overhang_m, window[1])
        )
        found.append(RoadPoints(d, sideways, h, np.full(len(d), run)).part(inside))
        which.append(near[inside])
    return RoadPoints.joined(found), np.concatenate(which)


def _reach(position: Array, corridor: Corridor) -> float:
    """How far from the nearest of the poses (M, 3) a point of the corridor can be, metres."""
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return float(np.hypot(corridor.half_width_m, corridor.max_height_m) + corridor.overhang_m + steps.max())


def _nearest(points: Array, position: Array, reach_m: float) -> NDArray[np.int64]:
    """See `corridor_kernels.nearest_poses`."""
    distance, nearest = cKDTree(position).query(points, distance_upper_bound=reach_m)
    return np.where(np.isfinite(distance), nearest, -1)


def _runs(path: ContactPath, window: tuple[float, float]) -> Iterator[tuple[int, int, int]]:
    """Each run of segments that touches the window, with its first and last knot in there."""
    first = max(int(np.searchsorted(path.knot_arc, window[0], side="left")) - 1, 0)
    last = int(np.searchsorted(path.knot_arc, window[1], side="right"))
    for run in np.unique(path.run[first:last]):
        segments = first + np.flatnonzero(path.run[first:last] == run)
        yield int(run), int(segments[0]), int(segments[-1]) + 1
