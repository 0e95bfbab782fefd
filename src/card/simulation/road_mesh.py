"""Triangles of the road's surface and of the land around it."""

import numpy as np
from numpy.typing import NDArray

from card.simulation.irregularities import BUMP_END_M, Bump, Irregularity, Pothole
from card.simulation.mesh import Mesh, grid, grid_triangles, join
from card.simulation.road import KERB_RUN_M, Road
from card.simulation.surfaces import Surface

Array = NDArray[np.float64]

FINE_STEP_M, COARSE_STEP_M = 0.1, 0.5
#: Along a bump's profile, and both ways on a pothole's steep wall: under 1 mm from the function.
BUMP_STEP_M, BUMP_END_STEP_M, POTHOLE_STEP_M = 0.02, 0.025, 0.0125
SKIRT_M, SKIRT_DROP_M = 3.0, 0.4
LAND_STEP_M, LAND_REACH_M = 4.0, 90.0


def road_mesh(road: Road, fine: tuple[float, float], whole: tuple[float, float]) -> Mesh:
    """The road over arc lengths ``whole`` (m), finely meshed within ``fine``; its things are irregularities.

    Road coordinates are its texture coordinates. A pothole's patch is cut out and meshed finer.
    """
    rows = _rows(road, fine, whole)
    columns = _columns(road)
    s, d = np.meshgrid(rows, columns, indexing="ij")
    points = road.xyz(s, d)
    skirt = np.abs(d) > road.section.reach + 1e-9
    points[..., 2] -= np.where(skirt, SKIRT_DROP_M, 0.0)
    sheet = _sheet(road, points, s, d)
    patches = []
    keep = np.ones(len(sheet.triangles), dtype=bool)
    middle_s, middle_d = (_cell_middles(v)[..., None].repeat(2, -1).ravel() for v in (s, d))
    for thing in road.irregularities:
        if not isinstance(thing, Pothole) or not rows[0] < thing.extent[0] < thing.extent[1] < rows[-1]:
            continue
        s_low, s_high = _around(rows, *thing.extent[:2])
        d_low, d_high = _around(columns, *thing.extent[2:])
        keep &= ~((middle_s > s_low) & (middle_s < s_high) & (middle_d > d_low) & (middle_d < d_high))
        ps, pd = np.meshgrid(_ticks(s_low, s_high), _ticks(d_low, d_high), indexing="ij")
        patches.append(_sheet(road, road.xyz(ps, pd), ps, pd))
    cut = Mesh(
        sheet.vertices,
        sheet.triangles[keep],
        sheet.uv,
        sheet.surface[keep],
        sheet.tint[keep],
        sheet.thing[keep],
    )
    return join([cut, *patches])


def land_mesh(road: Road, centre: Array) -> Mesh:
    """The land around points ``centre`` (N, 2) of the road, below its skirt."""
    low, high = centre.min(axis=0) - LAND_REACH_M, centre.max(axis=0) + LAND_REACH_M
    x, y = (np.arange(a, b + LAND_STEP_M, LAND_STEP_M) for a, b in zip(low, high, strict=True))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    edge = float(min(road.section.height(np.array([road.section.half_width, road.section.reach]))))
    points = np.concatenate([xy, (road.land(xy) + edge - SKIRT_DROP_M + 0.05)[..., None]], axis=-1)
    return grid(points, Surface.GRASS, uv=xy)


def _rows(road: Road, fine: tuple[float, float], whole: tuple[float, float]) -> Array:
    lines = [
        np.arange(round(whole[0] / COARSE_STEP_M), round(whole[1] / COARSE_STEP_M) + 1) * COARSE_STEP_M,
        np.arange(round(fine[0] / FINE_STEP_M), round(fine[1] / FINE_STEP_M) + 1) * FINE_STEP_M,
    ]
    for thing in road.irregularities:
        if isinstance(thing, Bump):
            count = round((thing.extent[1] - thing.extent[0]) / BUMP_STEP_M)
            lines.append(np.linspace(*thing.extent[:2], count + 1))
    ordered = np.unique(np.concatenate(lines))
    ordered = ordered[(ordered >= whole[0]) & (ordered <= whole[1])]
    return ordered[np.concatenate([[True], np.diff(ordered) > 1e-3])]


def _columns(road: Road) -> Array:
    section = road.section
    half = np.linspace(0.0, section.half_width, round(section.half_width / FINE_STEP_M) + 1)
    ends = {thing.d_max for thing in road.irregularities if isinstance(thing, Bump)}
    for end in sorted(ends):
        half = np.concatenate(
            [half, np.linspace(end - BUMP_END_M, end, round(BUMP_END_M / BUMP_END_STEP_M) + 1)]
        )
    half = np.unique(half)
    half = half[np.concatenate([[True], np.diff(half) > 1e-3])]
    beyond = np.linspace(section.half_width + KERB_RUN_M, section.reach, round(section.side_width / 0.4) + 1)
    right = np.concatenate([half, beyond, [section.reach + SKIRT_M]])
    return np.concatenate([-right[:0:-1], right])


def _sheet(road: Road, points: Array, s: Array, d: Array) -> Mesh:
    uv = np.stack([s, d], axis=-1)
    sheet = grid(points, Surface.ASPHALT, uv=uv)
    middle_s, middle_d = _cell_middles(s), _cell_middles(d)
    offset = np.abs(middle_d)
    section = road.section
    town = section.kerb > 0
    surface = np.select(
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
    thing = np.full(surface.shape, -1, np.int32)
    for index, irregularity in enumerate(road.irregularities):
        inside = _inside(irregularity, middle_s, middle_d)
        thing[inside] = index
        if isinstance(irregularity, Pothole):
            surface[inside] = Surface.POTHOLE
        elif section.paved:
            surface[inside] = Surface.BUMP
    assert sheet.triangles.shape == (2 * surface.size, 3)
    return Mesh(
        sheet.vertices,
        grid_triangles(*s.shape),
        sheet.uv,
        surface.ravel().repeat(2),
        sheet.tint,
        thing.ravel().repeat(2),
    )


def _inside(thing: Irregularity, s: Array, d: Array) -> NDArray[np.bool_]:
    s_min, s_max, d_min, d_max = thing.extent
    near = (s > s_min) & (s < s_max) & (d > d_min) & (d < d_max)
    if isinstance(thing, Pothole):
        near &= thing.height(s, d) < 0
    return near


def _cell_middles(v: Array) -> Array:
    return (v[1:, 1:] + v[:-1, :-1]) / 2


def _around(lines: Array, low: float, high: float) -> tuple[float, float]:
    return float(lines[lines <= low][-1]), float(lines[lines >= high][0])


def _ticks(low: float, high: float) -> Array:
    return np.linspace(low, high, round((high - low) / POTHOLE_STEP_M) + 1)
