"""Triangle meshes that carry what a sensor needs to know, and the few primitives things are built of."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.geometry import apply
from card.simulation.surfaces import Surface

Array = NDArray[np.float64]
WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Mesh:
    """Triangles with attributes.

    vertices : (V, 3) float64, m.  triangles : (T, 3) int32.
    uv : (V, 2) float32, texture coordinates: metres, or 0..1 on a pictured quad (v down).
    surface : (T,) uint8, ids of `Surface`.  tint : (T, 3) float32, factor on the surface's albedo.
    thing : (T,) int32, index of the bump, pothole, face or plate a triangle belongs to; -1 for none.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    surface: NDArray[np.uint8]
    tint: NDArray[np.float32]
    thing: NDArray[np.int32]

    def moved(self, pose: Array) -> "Mesh":
        """The mesh in frame ``a`` given ``a_from_mesh`` (4, 4)."""
        return replace(self, vertices=apply(pose, self.vertices))


def mesh(
    vertices: ArrayLike,
    triangles: ArrayLike,
    surface: Surface,
    tint: ArrayLike = WHITE,
    uv: ArrayLike | None = None,
    thing: int = -1,
) -> Mesh:
    """A mesh of one surface; without ``uv`` texture coordinates follow each vertex's x + y and z."""
    v = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    t = np.asarray(triangles, dtype=np.int32).reshape(-1, 3)
    flat = np.stack([v[:, 0] + v[:, 1], v[:, 2]], axis=1) if uv is None else np.asarray(uv)
    return Mesh(
        v,
        t,
        flat.astype(np.float32),
        np.full(len(t), surface, np.uint8),
        np.tile(np.asarray(tint, np.float32), (len(t), 1)),
        np.full(len(t), thing, np.int32),
    )


def join(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several in the same frame."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.triangles + start for m, start in zip(meshes, starts, strict=True)]).astype(
            np.int32
        ),
        np.concatenate([m.uv for m in meshes]),
        np.concatenate([m.surface for m in meshes]),
        np.concatenate([m.tint for m in meshes]),
        np.concatenate([m.thing for m in meshes]),
    )


def grid_triangles(rows: int, columns: int) -> NDArray[np.int32]:
    """Two triangles a cell (2 (rows-1) (columns-1), 3) of a grid of vertices, row after row."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
    cell = np.array([[0, 1, columns], [1, columns + 1, columns]])
    return (corner[:, None] + cell).reshape(-1, 3).astype(np.int32)


def grid(points: Array, surface: Surface, tint: ArrayLike = WHITE, uv: ArrayLike | None = None) -> Mesh:
    """A sheet through points (R, C, 3)."""
    flat = None if uv is None else np.asarray(uv).reshape(-1, 2)
    return mesh(points.reshape(-1, 3), grid_triangles(*points.shape[:2]), surface, tint, flat)


def box(low: ArrayLike, high: ArrayLike, surface: Surface, tint: ArrayLike = WHITE) -> Mesh:
    """An axis-aligned box; each face has corners of its own, textured in metres along it and up."""
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    sides = []
    for axis in range(3):
        first, second = [(1, 2), (0, 2), (0, 1)][axis]
        for end in (low, high):
            corners = np.tile(low, (4, 1))
            corners[:, axis] = end[axis]
            corners[[1, 2], first] = high[first]
            corners[[2, 3], second] = high[second]
            uv = corners[:, [first, second]] - low[[first, second]]
            sides.append(mesh(corners, [[0, 1, 2], [0, 2, 3]], surface, tint, uv))
    return join(sides)


def cylinder(
    foot: ArrayLike, top: ArrayLike, radii: tuple[float, float], surface: Surface, tint: ArrayLike = WHITE
) -> Mesh:
    """A closed cone frustum of 10 sides from foot (3,) to top (3,)."""
    foot, top = np.asarray(foot, dtype=np.float64), np.asarray(top, dtype=np.float64)
    axis = (top - foot) / np.linalg.norm(top - foot)
    side = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
    side /= np.linalg.norm(side)
    turn = np.linspace(0, 2 * np.pi, 11)
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(axis, side)
    levels = [foot + 0 * ring, foot + radii[0] * ring, top + radii[1] * ring, top + 0 * ring]
    length = float(np.linalg.norm(top - foot))
    uv = np.stack(np.broadcast_arrays(turn * max(radii), np.array([[0.0], [0], [length], [length]])), axis=-1)
    return grid(np.stack(levels), surface, tint, uv)


def ellipsoid(centre: ArrayLike, radii: ArrayLike, surface: Surface, tint: ArrayLike = WHITE) -> Mesh:
    """An ellipsoid of 8 x 12 patches."""
    height, turn = np.linspace(-np.pi / 2, np.pi / 2, 9)[:, None], np.linspace(0, 2 * np.pi, 13)
    unit = np.stack(
        np.broadcast_arrays(np.cos(height) * np.cos(turn), np.cos(height) * np.sin(turn), np.sin(height)),
        axis=-1,
    )
    return grid(np.asarray(centre) + np.asarray(radii) * unit, surface, tint)


def picture(corners: ArrayLike, surface: Surface, thing: int) -> Mesh:
    """A pictured quad; corners (4, 3) are its upper left, upper right, lower right and lower left."""
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], surface, uv=uv, thing=thing)
