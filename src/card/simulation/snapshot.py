"""The world at one instant, for a global shutter: all movers stand where they are at that time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import inverse
from card.simulation.compiled import compiled
from card.simulation.gallery import REACH_M
from card.simulation.mesh import join
from card.simulation.raycast import Scene, Tracer

Array = NDArray[np.float64]
Image = NDArray[np.float32]


@dataclass(frozen=True)
class Sight:
    """What the rays of one viewpoint meet, N of them.

    distance : (N,) m, inf for nothing.  triangle : (N,) int32 into `Tracer.all`, -1 for nothing.
    barycentric : (N, 2).  normal : (N, 3), unit, towards the viewpoint.  point : (N, 3) in world.
    facing : (N,), cosine of incidence.
    """

    distance: Image
    triangle: NDArray[np.int32]
    barycentric: Image
    normal: Image
    point: Image
    facing: Image


class Snapshot:
    """Static world and movers near ``viewpoint`` (3,) at ``t_ns``, and how these move ``around_ns`` about."""

    def __init__(self, tracer: Tracer, viewpoint: Array, t_ns: int, around_ns: int = 0) -> None:
        self._static = tracer.static
        poses = [mover.path.at(t_ns) for mover in tracer.movers]
        near = [k for k, pose in enumerate(poses) if np.linalg.norm(pose[:3, 3] - viewpoint) < REACH_M]
        self._moving = Scene(join([tracer.movers[k].mesh.moved(poses[k]) for k in near])) if near else None
        sizes = [len(tracer.movers[k].mesh.triangles) for k in near]
        # Triangles of `near`, one after the other, as those of all bodies are numbered.
        self._number = np.concatenate(
            [
                np.zeros(0, np.int32),
                *(tracer.first_triangle[k] + np.arange(n) for k, n in zip(near, sizes, strict=True)),
            ]
        ).astype(np.int32)
        self._first = tracer.first_triangle
        self._turns = {}
        for k in near:
            path, back = tracer.movers[k].path, inverse(poses[k])
            self._turns[k] = (path.at(t_ns + around_ns) - path.at(t_ns - around_ns)) @ back
        self.static_triangles = tracer.static_triangles

    def look(self, origin: Array, rays: Image) -> Sight:
        """First hits of rays (N, 3), unit vectors in world, from ``origin`` (3,)."""
        six = np.empty((len(rays), 6), np.float32)
        six[:, :3], six[:, 3:] = origin, rays
        hits = self._static.first(six)
        if self._moving is not None:
            moving = self._moving.first(six)
            nearer = np.flatnonzero(moving.distance < hits.distance)
            hits.distance[nearer] = moving.distance[nearer]
            hits.triangle[nearer] = self._number[moving.triangle[nearer]]
            hits.barycentric[nearer] = moving.barycentric[nearer]
            hits.normal[nearer] = moving.normal[nearer]
        point = six[:, :3].copy()
        facing = _face(hits.normal, six, hits.distance, point)
        return Sight(hits.distance, hits.triangle, hits.barycentric, hits.normal, point, facing)

    def sees(self, ways: Image) -> NDArray[np.bool_]:
        """Whether nothing blocks ways (N, 6): where each starts and how far it goes."""
        clear = ~self._static.blocked(ways)
        if self._moving is not None:
            clear &= ~self._moving.blocked(ways)
        return clear

    def shift(self, sight: Sight) -> tuple[NDArray[np.intp], Image]:
        """Rays (K,) that meet movers, and how far (K, 3) in world what they meet moves in this time."""
        ray = np.flatnonzero(sight.triangle >= self.static_triangles)
        mover = np.searchsorted(self._first, sight.triangle[ray], side="right") - 1
        way = np.zeros((len(ray), 3), np.float32)
        for k in np.unique(mover):
            own = mover == k
            turn = self._turns[int(k)]
            way[own] = sight.point[ray[own]] @ turn[:3, :3].T.astype(np.float32) + turn[:3, 3]
        return ray, way


@compiled
def _face(normal: Image, six: Image, distance: Image, point: Image) -> Image:
    """Turn normals towards the viewpoint, put points where rays end; the cosines of incidence."""
    facing = np.empty(len(normal), np.float32)
    for i in range(len(normal)):
        cosine = np.float32(0)
        for k in range(3):
            cosine += normal[i, k] * six[i, 3 + k]
        for k in range(3):
            if cosine > 0:
                normal[i, k] = -normal[i, k]
            point[i, k] += six[i, 3 + k] * distance[i]
        facing[i] = abs(cosine)
    return facing
