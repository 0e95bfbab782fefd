"""Distance along a contact path and height over it, for points near the path."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from card.wheels.contact_path import ContactPath

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corridor:
    """How far from the path a point may lie: sideways and in height, metres."""

    half_width_m: float
    max_height_m: float


def project(points: Array, position: Array, rotation: Array, arc: Array) -> tuple[Array, Array, Array]:
    """Arc length d_p, height h_p and sideways offset of points, each (P,), in metres.

    points : (P, 3) world. position, rotation, arc : (M, 3), (M, 3, 3), (M,) poses of the path, M >= 2.
    Supplement, "Wheel Excitation": alpha, d_p and h_p between the two closest adjacent poses; the offset is
    the x component where h_p is the z component.
    """
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


def corridor_samples(
    points: Array, path: ContactPath, window: tuple[float, float], corridor: Corridor
) -> tuple[Array, Array]:
    """Arc lengths and heights (Q,), (Q,) of the points (P, 3) that lie in the corridor of one pass.

    The pass is the piece of path with arc lengths in `window`, so that a street driven twice keeps its two
    passes apart. Runs forward and in reverse over the same ground each take the points.
    """
    arcs, heights = [np.zeros(0)], [np.zeros(0)]
    for first, last in _runs(path, window):
        piece = slice(first, last + 1)
        arc = path.knot_arc[piece]
        d, h, sideways = project(points, path.knot_position[piece], path.knot_rotation[piece], arc)
        inside = (np.abs(sideways) <= corridor.half_width_m) & (np.abs(h) <= corridor.max_height_m)
        inside &= (d >= max(arc[0], window[0])) & (d <= min(arc[-1], window[1]))
        arcs.append(d[inside])
        heights.append(h[inside])
    return np.concatenate(arcs), np.concatenate(heights)


def _runs(path: ContactPath, window: tuple[float, float]) -> Iterator[tuple[int, int]]:
    """First and last knot of each run of segments that touches the window."""
    touching = np.flatnonzero((path.knot_arc[1:] >= window[0]) & (path.knot_arc[:-1] <= window[1]))
    for run in np.unique(path.run[touching]):
        segments = touching[path.run[touching] == run]
        yield int(segments[0]), int(segments[-1]) + 1
