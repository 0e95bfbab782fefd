"""Fine meshes of what interrupts a road, each fitted into a hole in the road's coarser sheet."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from card.simulation.irregularities import (
    BUMP_END_M,
    PATCH_EDGE_M,
    Bump,
    Manhole,
    Patch,
    Pothole,
)
from card.simulation.mesh import Mesh, grid_triangles
from card.simulation.road import Road
from card.simulation.surfaces import Surface

Array = NDArray[np.float64]

#: Along a bump, across its ends, and along the edge of a round one's hole: under 1 mm from the function.
BUMP_STEP_M, BUMP_END_STEP_M, RING_STEP_M = 0.04, 0.025, 0.025
#: Rings of vertices on a round one's floor, wall and surroundings, as shares from inner to outer edge.
_FLOOR, _WALL, _AROUND = np.linspace(0.02, 1, 6), np.linspace(0, 1, 13), np.linspace(0, 1, 4)
_SURFACES = {"pothole": Surface.POTHOLE, "manhole": Surface.MANHOLE, "patch": Surface.PATCH}


def patch(road: Road, index: int, s_lines: Array, d_lines: Array, ground: Surface) -> Mesh:
    """The road within a hole of its sheet, finely meshed around irregularity ``index``.

    s_lines, d_lines : the sheet's grid lines across the hole and on its edges, m, ascending.
    ground : what the road around it is made of.
    """
    thing = road.irregularities[index]
    if isinstance(thing, Pothole | Manhole):
        s, d = _rings(thing, s_lines, d_lines)
    else:
        along, across = _lines(thing)
        s, d = np.meshgrid(_merged(s_lines, along), _merged(d_lines, across), indexing="ij")
    middle_s, middle_d = ((v[1:, 1:] + v[:-1, :-1] + v[1:, :-1] + v[:-1, 1:]) / 4 for v in (s, d))
    inside = thing.height(middle_s, middle_d) != 0
    # Bumps of gravel are gravel.
    own = _SURFACES.get(thing.kind, Surface.BUMP if ground == Surface.ASPHALT else ground)
    surface = np.where(inside, own, ground).astype(np.uint8).ravel().repeat(2)
    triangles = grid_triangles(*s.shape)
    return Mesh(
        road.xyz(s, d).reshape(-1, 3),
        triangles,
        np.stack([s, d], axis=-1).reshape(-1, 2).astype(np.float32),
        surface,
        np.ones((len(triangles), 3), np.float32),
        np.where(inside, index, -1).astype(np.int32).ravel().repeat(2),
    )


def _lines(thing: Bump | Patch) -> tuple[Array, Array]:
    """Grid lines along and across that follow the profile, its edges among them."""
    s_min, s_max, d_min, d_max = thing.extent
    if isinstance(thing, Patch):
        edge = PATCH_EDGE_M
        return (np.array([s_min, s_min + edge, s_max - edge, s_max]),
                np.array([d_min, d_min + edge, d_max - edge, d_max]))  # fmt: skip
    kinks = np.array([s_min, s_min + thing.ramp, s_max - thing.ramp, s_max])
    even = np.linspace(s_min, s_max, round(thing.length / BUMP_STEP_M) + 1)
    end = np.linspace(0.0, BUMP_END_M, round(BUMP_END_M / BUMP_END_STEP_M) + 1)
    return _merged(even, kinks), np.concatenate([d_min + end, d_max - end[::-1]])


def _merged(lines: Array, others: Array) -> Array:
    """Both sets of grid lines in order, within ``lines``; others give way to them within a millimetre."""
    near = np.abs(others[:, None] - lines).min(axis=1) < 1e-3
    merged = np.unique(np.concatenate([lines, others[~near]]))
    return merged[(merged >= lines[0]) & (merged <= lines[-1])]


def _rings(thing: Pothole | Manhole, s_lines: Array, d_lines: Array) -> tuple[Array, Array]:
    """Road coordinates (R, C) of rings that end on the hole's rectangular edge, all the way round."""
    s_steps, d_steps = _split(s_lines), _split(d_lines)
    s_edge = np.concatenate(
        [s_steps, np.full(len(d_steps), s_lines[-1]), s_steps[::-1], np.full(len(d_steps), s_lines[0])]
    )
    d_edge = np.concatenate(
        [np.full(len(s_steps), d_lines[0]), d_steps, np.full(len(s_steps), d_lines[-1]), d_steps[::-1]]
    )
    u, v = (s_edge - thing.s) / thing.along, (d_edge - thing.d) / thing.across
    away = np.hypot(u, v)
    outer = thing.edge(np.arctan2(v, u))
    inner = outer - thing.wall
    shares = np.concatenate(
        [
            _FLOOR[:-1, None] * inner,
            inner + _WALL[:, None] * thing.wall,
            outer + _AROUND[1:, None] * (away - outer),
        ]
    )
    shares = np.concatenate([0 * shares[:1], shares]) / away
    return thing.s + shares * (s_edge - thing.s), thing.d + shares * (d_edge - thing.d)


def _split(lines: Array) -> Array:
    """Grid lines with steps of at most RING_STEP_M between them."""
    parts = [
        np.linspace(a, b, max(round((b - a) / RING_STEP_M), 1), endpoint=False) for a, b in pairwise(lines)
    ]
    return np.concatenate([*parts, lines[-1:]])
