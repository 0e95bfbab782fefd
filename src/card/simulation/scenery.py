"""What stands beside a road: houses, poles, trees and parked cars."""

import numpy as np
from numpy.typing import NDArray

from card.simulation.mesh import Mesh, box, cylinder, join, mesh
from card.simulation.road import Road
from card.simulation.surfaces import Surface

Array = NDArray[np.float64]
FOUNDATION_M = 1.0
#: Sprays of leaves in a crown of 1 m (in others by the area of their outline), and one sigma of a corner.
_LEAVES, _LEAF_M = 450, 0.09


def houses(road: Road, span: tuple[float, float], depth: float, rng: np.random.Generator) -> list[Mesh]:
    """Rows of houses on both sides over arc lengths ``span`` (m), ``depth`` m deep, with a few gaps."""
    found = []
    for side in (-1.0, 1.0):
        s = span[0] + rng.uniform(0, 4)
        while s < span[1]:
            length, height = rng.uniform(8, 15), rng.uniform(6, 12)
            if rng.random() < 0.85:
                found.append(_house(road, s + length / 2, side, length, height, depth, rng))
            s += length + rng.choice([0.0, 0.0, 2.5])
    return found


Place = tuple[float, float]


def pole_places(road: Road, span: tuple[float, float], rng: np.random.Generator) -> list[Place]:
    """Road coordinates of street lamps every 22 m or so, on alternating sides."""
    offset = road.section.half_width + 0.45
    return [
        (s + rng.uniform(-2, 2), -offset if index % 2 else offset)
        for index, s in enumerate(np.arange(span[0], span[1], 22.0).tolist())
    ]


def poles(road: Road, places: list[Place]) -> tuple[list[Mesh], list[Array]]:
    """Street lamps: meshes, and where (3,) each one's light is."""
    found, lights = [], []
    for s, d in places:
        side = np.sign(d)
        lamp = join(
            [
                cylinder((0, 0, -0.3), (0, 0, 5.5), (0.07, 0.05), Surface.POLE),
                cylinder((0, 0, 5.5), (-side * 1.2, 0, 5.7), (0.04, 0.04), Surface.POLE),
                box((-side * 1.2 - 0.25, -0.1, 5.66), (-side * 1.2 + 0.25, 0.1, 5.74), Surface.POLE),
                box((-side * 1.2 - 0.20, -0.08, 5.62), (-side * 1.2 + 0.20, 0.08, 5.66), Surface.LAMP),
            ]
        )
        pose = road.pose(s, d)
        found.append(lamp.moved(pose))
        lights.append(pose[:3, 3] + pose[:3, :3] @ [-side * 1.2, 0.0, 5.6])
    return found, lights


def tree_places(
    road: Road, span: tuple[float, float], spacing: float, rng: np.random.Generator, *, street: bool
) -> list[Place]:
    """Road coordinates of plants, ``spacing`` m apart on each side, at the kerb or beyond the verge."""
    near, far = (0.35, 0.4) if street else (road.section.side_width - 0.5, road.section.side_width + 5)
    return [
        (s + rng.uniform(-0.4, 0.4) * spacing, side * (road.section.half_width + rng.uniform(near, far)))
        for side in (-1.0, 1.0)
        for s in np.arange(span[0], span[1], spacing).tolist()
    ]


def trees(road: Road, places: list[Place], rng: np.random.Generator, *, street: bool) -> list[Mesh]:
    """Trees, and beside open roads bushes among them."""
    found = []
    for s, d in places:
        if street:
            plant = _tree(rng, rng.uniform(3.0, 3.6), rng.uniform(0.9, 1.4))
        elif rng.random() < 0.3:
            plant = _bush(rng)
        else:
            plant = _tree(rng, rng.uniform(2.2, 3.2), rng.uniform(1.3, 2.2))
        edge = np.clip(d, -road.section.reach, road.section.reach)
        pose = road.pose(s, edge)
        pose[:3, 3] += pose[:3, 0] * (d - edge)
        pose[2, 3] -= 0.0 if street else 0.3
        found.append(plant.moved(pose))
    return found


def _house(
    road: Road, s: float, side: float, length: float, height: float, depth: float, rng: np.random.Generator
) -> Mesh:
    tint = rng.uniform(0.75, 1.15) * rng.uniform(0.85, 1.1, 3)
    low, high = (0.0, -length / 2, -FOUNDATION_M), (depth, length / 2, height)
    eaves = 0.35
    walls = box(low, high, Surface.FACADE, tint)
    roof = box((-eaves, -length / 2, height), (depth + eaves, length / 2, height + 0.8), Surface.ROOF, tint)
    # Inside a bend its corners must not stand on the sidewalk.
    inward = max(0.0, float(-(side * road.line.curvature(s + np.linspace(-0.5, 0.5, 5) * length)).min()))
    back = inward / max(1 - inward * road.section.reach, 0.3) * length**2 / 8
    pose = road.pose(s, side * (road.section.reach + 0.2 + back), 0.0 if side > 0 else np.pi)
    return join([walls, roof]).moved(pose)


def _tree(rng: np.random.Generator, height: float, radius: float) -> Mesh:
    """A trunk ``height`` m tall below a crown of ``radius`` m."""
    crown = np.array([radius, radius, rng.uniform(1.15, 1.25) * radius])
    return join(
        [
            cylinder((0, 0, -0.5), (0, 0, height + 1.0), (0.18, 0.10), Surface.TRUNK),
            _leaves(np.array([0, 0, height + 0.7 * crown[2]]), crown, rng),
        ]
    )


def _bush(rng: np.random.Generator) -> Mesh:
    radii = rng.uniform(0.5, 1.1, 3)
    return _leaves(np.array([0, 0, 0.3 + 0.7 * radii[2]]), radii, rng)


def _leaves(centre: Array, radii: Array, rng: np.random.Generator) -> Mesh:
    """Loose triangles in an ellipsoid: vegetation that lets some rays through."""
    count = round(_LEAVES * float(np.prod(radii)) ** (2 / 3))
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    middle = direction * np.cbrt(rng.uniform(0.25, 1, (count, 1))) * radii
    corners = middle[:, None] + rng.normal(0, _LEAF_M, (count, 3, 3))
    leaves = mesh(
        corners.reshape(-1, 3) + centre, np.arange(3 * count), Surface.FOLIAGE, rng.uniform(0.8, 1.2, 3)
    )
    leaves.tint[:] *= rng.uniform(0.6, 1.3, (count, 1)).astype(np.float32)
    return leaves
