"""The points that a viewer at the origin sees, exactly and fast."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.ground_truth.hpr.candidates import farthest, low_enough, near_enough
from card.ground_truth.hpr.cells import EMPTY, Cells, assign, indices, lay_out, place_all, survey
from card.ground_truth.hpr.insertion_order import by_rounds, morton_order
from card.ground_truth.hpr.lift import COLUMNS, lift
from card.ground_truth.hpr.triangulation import CORNERS, MAX_STEPS, Mesh, add_corners, lower_hull
from card.ground_truth.hpr.upper_bound import upper_bound
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.reference.hidden_points import spans_space, visible_by_hull

Points = npt.NDArray[np.float64]


def visible_points(
    points: npt.NDArray[np.float64],
    radius: float,
    workspace: Workspace | None = None,
    *,
    mostly_visible: bool = False,
) -> npt.NDArray[np.int64]:
    """Increasing indices of the points (N, 3), metres, that a viewer at the origin sees, looking along +z.

    The same set as `visible_by_hull` gives, once points closer together than 1e-8 m are merged: of those one
    is returned. `radius` is that of the sphere of the flip, metres. Where points are `mostly_visible` it does
    not pay to look for hidden ones first.

    Raises
    ------
    CardError
        If a point is not in front of the viewer (z > 0), or as far as the radius: the flip of a point beyond
        the sphere says nothing.
    """
    u_low, u_high, v_low, v_high, bad = survey(points, radius)
    if bad >= 0:
        _refuse(points[bad], radius)
    if not spans_space(points):
        return np.arange(len(points))
    memory = workspace or Workspace()
    cells = lay_out(u_low, u_high, v_low, v_high, len(points))
    candidates = _all if mostly_visible else _candidates
    index, lifted, place = candidates(points, 2 * radius, cells, memory)
    unsorted, order, morton, sequence = memory.take("order", (4, len(index)), np.uint32)
    morton_order(place, unsorted, order, morton)
    ordered = memory.take("ordered", (len(index) + CORNERS, COLUMNS), np.float64)
    # Clipped, as numpy copies what it may have to refuse.
    np.take(lifted, order, axis=0, out=ordered[:-CORNERS], mode="clip")
    add_corners(ordered, cells)
    by_rounds(ordered, morton, sequence, memory.take("used", len(index), np.bool_))
    vertex = np.zeros(len(ordered), np.bool_)
    if not lower_hull(ordered, sequence, Mesh.of(len(index), memory), vertex, MAX_STEPS):
        return visible_by_hull(points, radius)
    seen = np.zeros(len(points), np.bool_)
    seen[index[order[vertex[:-CORNERS]]]] = True
    return np.flatnonzero(seen)


def _all(
    points: Points, diameter: float, cells: Cells, memory: Workspace
) -> tuple[npt.NDArray[np.uint32], Points, npt.NDArray[np.uint16]]:
    """Every point as `_candidates` gives them."""
    index = np.arange(len(points), dtype=np.uint32)
    lifted = memory.take("lifted", (len(points), COLUMNS), np.float64)
    lift(points, index, diameter, lifted)
    place = memory.take("place", (len(points), 2), np.uint16)
    place_all(points, cells, place)
    return index, lifted, place


def _candidates(
    points: Points, diameter: float, cells: Cells, memory: Workspace
) -> tuple[npt.NDArray[np.uint32], Points, npt.NDArray[np.uint16]]:
    """What may be visible: indices (M,), lifted (M, 4), and places (M, 2) as `place_all` writes them."""
    nearest = memory.take("nearest", cells.rows * cells.columns, np.uint64)
    nearest[:] = EMPTY
    cell = memory.take("cell", len(points), np.uint32)
    range2 = memory.take("range2", len(points), np.float32)
    assign(points, cells, cell, range2, nearest)
    occupied, first = indices(nearest)
    lifted = memory.take("lifted", (len(first), COLUMNS), np.float64)
    lift(points, first, diameter, lifted)
    bound = upper_bound(cells, occupied, lifted, memory)
    limit = memory.take("limit", len(nearest), np.float32)
    farthest(bound, cells, diameter, limit)
    index = memory.take("near enough", len(points) + 1, np.uint32)
    index = index[: near_enough(cell, range2, limit, index)]
    lifted = memory.take("lifted", (len(index), COLUMNS), np.float64)
    lift(points, index, diameter, lifted)
    place = memory.take("place", (len(index), 2), np.uint16)
    count = low_enough(lifted, index, bound, cells, place)
    return index[:count], lifted[:count], place[:count]


def _refuse(point: Points, radius: float) -> NoReturn:
    if not point[2] > 0:
        raise CardError(
            "hidden-point removal looks along +z only", found=f"a point at z = {point[2]:g} m", wanted="z > 0"
        )
    raise CardError(
        "cloud is too far away for hidden-point removal",
        found=f"a point at {np.linalg.norm(point):.1f} m",
        wanted=f"less than the radius of {radius:.1f} m",
    )
