"""The ground under a tyre's footprint: its mean height, and whether it has a wall, as at a pothole's edge."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.open3d import import_open3d

Array = NDArray[np.float64]
#: The tyre's footprint of the truth, along and across it, m.
FOOTPRINT_M = (0.24, 0.20)
#: Rays a footprint has along and across, and from how high above the contact they look down, m.
RAYS, LOOK_M = (25, 21), 0.5
#: A wall rises faster than this over the ground between two rays: 45 degrees.
WALL_SLOPE = 1.0
#: Ways between samples along which a wheel's samples share an answer: a car that stands asks once, m.
STEP_M = 0.01
CONTACTS_AT_ONCE = 2000


@dataclass(frozen=True)
class TyreGround:
    """Under each of N footprints: the surface's mean height, m in world, and whether it has a wall."""

    height: Array
    wall: NDArray[np.bool_]


def ground_under(world: Path, contacts: Array, forward: Array) -> TyreGround:
    """The ground under footprints at contacts (N, 3) heading along `forward` (N, 2).

    world : ``world.npz`` of the truth, the surface that the sensors saw. The road it was meshed from is some
    tenths of a millimetre lower where a rut or a rough spot is rounder than the mesh. A tyre is not a point,
    so what is right across a wall is a matter of definition: these samples are reported apart.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(contacts[:, :2], axis=0), axis=1))])
    _, asked, answer = np.unique(np.floor(arc / STEP_M), return_index=True, return_inverse=True)
    scene, above, wall = _scene(world), np.zeros(len(asked)), np.zeros(len(asked), dtype=np.bool_)
    along, over = (_trapezoid(rays) for rays in RAYS)
    for start in range(0, len(asked), CONTACTS_AT_ONCE):
        block = slice(start, start + CONTACTS_AT_ONCE)
        some = asked[block]
        heights = _heights(scene, contacts[some], forward[some])
        slopes = [
            np.abs(np.diff(heights, axis=axis)).max(axis=(1, 2)) / (length / (rays - 1))
            for axis, length, rays in zip((1, 2), FOOTPRINT_M, RAYS, strict=True)
        ]
        wall[block] = np.maximum(*slopes) > WALL_SLOPE
        above[block] = np.einsum("nab,a,b->n", heights, along, over) - contacts[some, 2]
    return TyreGround(contacts[:, 2] + above[answer], wall[answer])


def _trapezoid(count: int) -> Array:
    """Weights (count,) of evenly spaced values in their mean."""
    weights = np.ones(count)
    weights[[0, -1]] = 0.5
    return weights / weights.sum()


def _heights(scene: Any, contacts: Array, forward: Array) -> Array:
    """Surface heights (N, A, B) under the rays of each footprint, m; the lowest seen where nothing is hit."""
    o3d = import_open3d()
    a, b = (
        np.linspace(-length / 2, length / 2, rays) for length, rays in zip(FOOTPRINT_M, RAYS, strict=True)
    )
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.stack([forward[:, 1], -forward[:, 0]], axis=1)
    xy = (
        contacts[:, None, None, :2]
        + a[:, None, None] * forward[:, None, None]
        + b[:, None] * right[:, None, None]
    )
    top = np.broadcast_to(contacts[:, 2, None, None, None] + LOOK_M, (*xy.shape[:3], 1))
    down = np.broadcast_to(np.array([0.0, 0.0, -1.0]), (*xy.shape[:3], 3))
    rays = np.concatenate([xy, top, down], axis=-1).astype(np.float32)
    fallen = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy().astype(np.float64)
    heights: Array = top[..., 0] - np.where(np.isfinite(fallen), fallen, LOOK_M)
    return heights


def _scene(world: Path) -> Any:
    o3d = import_open3d()
    with np.load(world) as mesh:
        vertices = o3d.core.Tensor(mesh["vertices"].astype(np.float32))
        triangles = o3d.core.Tensor(mesh["triangles"].astype(np.uint32))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices, triangles)
    return scene
