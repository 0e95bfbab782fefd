"""Triangles of the road's surface and of the land around it."""

import numpy as np
from numpy.typing import NDArray

from card.simulation.mesh import Mesh, grid, join
from card.simulation.road import KERB_RUN_M, Road
from card.simulation.road_patches import patch
from card.simulation.surfaces import Surface

Array = NDArray[np.float64]

FINE_STEP_M, COARSE_STEP_M = 0.1, 0.5
SKIRT_M, SKIRT_DROP_M = 3.0, 0.4
LAND_STEP_M, LAND_REACH_M = 4.0, 90.0


def road_mesh(road: Road, fine: tuple[float, float], whole: tuple[float, float]) -> Mesh:
    """The road over arc lengths ``whole`` (m), finely meshed within ``fine``; its things are irregularities.

    Road coordinates are its texture coordinates. What is around an irregularity is cut out and meshed finer.
    """
    rows, columns = _rows(fine, whole), _columns(road)
    s, d = np.meshgrid(rows, columns, indexing="ij")
    points = road.bare(s, d)
    skirt = np.abs(d) > road.section.reach + 1e-9
    points[..., 2] -= np.where(skirt, SKIRT_DROP_M + 2 * road.section.tilt_m, 0.0)
    sheet = grid(points, Surface.ASPHALT, uv=np.stack([s, d], axis=-1))
    surface = _surfaces(road, (columns[1:] + columns[:-1]) / 2)
    sheet.surface[:] = np.tile(surface.repeat(2), len(rows) - 1)
    ground = Surface.ASPHALT if road.section.paved else Surface.GRAVEL
    patches, cut = [], np.zeros((len(rows) - 1, len(columns) - 1), dtype=bool)
    for index, thing in enumerate(road.irregularities):
        s_min, s_max, d_min, d_max = thing.extent
        if not rows[0] < s_min < s_max < rows[-1]:
            continue
        s_hole, d_hole = _around(rows, s_min, s_max), _around(columns, d_min, d_max)
        cut[s_hole.start : s_hole.stop - 1, d_hole.start : d_hole.stop - 1] = True
        patches.append(patch(road, index, rows[s_hole], columns[d_hole], ground))
    keep = ~cut.ravel().repeat(2)
    rest = Mesh(
        sheet.vertices,
        sheet.triangles[keep],
        sheet.uv,
        sheet.surface[keep],
        sheet.tint[keep],
        sheet.thing[keep],
    )
    return join([rest, *patches])


def land_mesh(road: Road, centre: Array) -> Mesh:
    """The land around points ``centre`` (N, 2) of the road, below its skirt."""
    low, high = centre.min(axis=0) - LAND_REACH_M, centre.max(axis=0) + LAND_REACH_M
    x, y = (np.arange(a, b + LAND_STEP_M, LAND_STEP_M) for a, b in zip(low, high, strict=True))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    edge = float(min(road.section.height(np.array([road.section.half_width, road.section.reach]))))
    points = np.concatenate(
        [xy, (road.land(xy) + edge - road.section.tilt_m - SKIRT_DROP_M + 0.05)[..., None]], axis=-1
    )
    return grid(points, Surface.GRASS, uv=xy)


def _rows(fine: tuple[float, float], whole: tuple[float, float]) -> Array:
    lines = [
        np.arange(round(whole[0] / COARSE_STEP_M), round(whole[1] / COARSE_STEP_M) + 1) * COARSE_STEP_M,
        np.arange(round(fine[0] / FINE_STEP_M), round(fine[1] / FINE_STEP_M) + 1) * FINE_STEP_M,
    ]
    ordered = np.unique(np.concatenate(lines))
    ordered = ordered[(ordered >= whole[0]) & (ordered <= whole[1])]
    return ordered[np.concatenate([[True], np.diff(ordered) > 1e-3])]


def _columns(road: Road) -> Array:
    section = road.section
    half = np.linspace(0.0, section.half_width, round(section.half_width / FINE_STEP_M) + 1)
    beyond = np.linspace(section.half_width + KERB_RUN_M, section.reach, round(section.side_width / 0.4) + 1)
    right = np.concatenate([half, beyond, [section.reach + SKIRT_M]])
    return np.concatenate([-right[:0:-1], right])


def _surfaces(road: Road, middle: Array) -> NDArray[np.uint8]:
    """What the road is made of at lateral offsets (C,)."""
    offset, section = np.abs(middle), road.section
    town = section.kerb > 0
    return np.select(
        [
            offset < section.half_width,
            offset < section.half_width + KERB_RUN_M + 0.12,
            offset < section.reach,
        ],
        [
            Surface.ASPHALT if section.paved else Surface.GRAVEL,
            Surface.KERB if town else Surface.GRASS,
            Surface.SIDEWALK if town else Surface.GRASS,
        ],
        Surface.GRASS,
    ).astype(np.uint8)


def _around(lines: Array, low: float, high: float) -> slice:
    """The grid lines from the last one at or below ``low`` to the first one at or above ``high``."""
    first = int(np.searchsorted(lines, low, side="right")) - 1
    return slice(first, int(np.searchsorted(lines, high, side="left")) + 1)
