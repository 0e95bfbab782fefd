"""All movers in one scene, each in a stand of its own: rays are brought to them instead of them to the rays.

A mover's mesh never moves in the scene. A ray that may meet it is expressed in the mover's frame at the ray's
own time and cast inside that mover's stand, so one call serves all movers and all times.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.artifacts.open3d import import_open3d
from card.geometry import Trajectory, matrix_from_quaternion
from card.simulation.mesh import Mesh

Array = NDArray[np.float64]

#: Movers farther than this are out of every sensor's reach.
REACH_M = 150.0
#: Rays are sorted out in runs of neighbours, so that most movers can be ruled out for a whole run.
_BLOCK = 2048


@dataclass(frozen=True)
class Encounters:
    """Rays that met movers, one entry a pair: index of the ray (K,); the rest as in `Hits`, in world."""

    ray: NDArray[np.intp]
    distance: Array
    triangle: NDArray[np.int64]
    barycentric: NDArray[np.float32]
    normal: Array


class Gallery:
    """Meshes and their paths ``world_from_body``, which share one time grid."""

    def __init__(self, meshes: Sequence[Mesh], paths: Sequence[Trajectory]) -> None:
        o3d = import_open3d()
        self._tensor = o3d.core.Tensor
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._t_ns = paths[0].t_ns
        assert all(np.array_equal(p.t_ns, self._t_ns) for p in paths)
        self._position = np.stack([p.translation_m for p in paths])
        self._rotation = np.stack([p.rotation_wxyz for p in paths])
        bounds = [(m.vertices.min(axis=0), m.vertices.max(axis=0)) for m in meshes]
        self._centre = np.array([(low + high) / 2 for low, high in bounds])
        self._radius = np.array(
            [np.linalg.norm(m.vertices - c, axis=1).max() for m, c in zip(meshes, self._centre, strict=True)]
        )
        # A stand is wide enough that a ray entering at its mover's sphere starts inside its own stand.
        side, row = 4 * float(self._radius.max()), int(np.ceil(np.sqrt(len(meshes))))
        number = np.arange(len(meshes))
        self._stand = side * np.stack([number % row, number // row, 0 * number], axis=1) - self._centre
        for mesh, stand in zip(meshes, self._stand, strict=True):
            vertices = (mesh.vertices + stand).astype(np.float32)
            self._scene.add_triangles(self._tensor(vertices), self._tensor(mesh.triangles.astype(np.uint32)))
        self._first = np.cumsum([0, *(len(m.triangles) for m in meshes[:-1])])

    def cast(self, origins: Array, directions: Array, t_ns: NDArray[np.int64]) -> Encounters:
        """Encounters of rays (N, 3) in world, directions of unit length, at times t_ns (N,)."""
        ray, mover = self._candidates(origins, directions, t_ns)
        rotation, position = self._poses(mover, t_ns[ray])
        origin = np.einsum("kij,ki->kj", rotation, origins[ray] - position) - self._centre[mover]
        direction = np.einsum("kij,ki->kj", rotation, directions[ray])
        nearest = -np.sum(origin * direction, axis=1)
        radius = self._radius[mover]
        passes = (np.sum(origin**2, axis=1) - nearest**2 < radius**2) & (nearest > -radius)
        ray, mover, rotation, nearest = ray[passes], mover[passes], rotation[passes], nearest[passes]
        start = np.maximum(nearest - self._radius[mover], 0.0)
        origin, direction = origin[passes], direction[passes]
        entry = origin + start[:, None] * direction + self._centre[mover] + self._stand[mover]
        rays = np.concatenate([entry, direction], axis=1).astype(np.float32)
        found = self._scene.cast_rays(self._tensor(rays), nthreads=1)
        own = found["geometry_ids"].numpy() == mover
        triangle = found["primitive_ids"].numpy()[own].astype(np.int64) + self._first[mover[own]]
        return Encounters(
            ray[own],
            found["t_hit"].numpy()[own].astype(np.float64) + start[own],
            triangle,
            found["primitive_uvs"].numpy()[own],
            np.einsum("kij,kj->ki", rotation[own], found["primitive_normals"].numpy()[own]),
        )

    def _candidates(
        self, origins: Array, directions: Array, t_ns: NDArray[np.int64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs of ray and mover that a cone around the mover's whereabouts does not rule out."""
        viewpoint = origins.mean(axis=0)
        spread = float(np.linalg.norm(origins - viewpoint, axis=1).max())
        movers = np.arange(len(self._radius))
        ends = []
        for t in (t_ns.min(), t_ns.max()):
            rotation, position = self._poses(movers, np.full(len(movers), t))
            ends.append(position + np.einsum("kij,kj->ki", rotation, self._centre))
        offset = (ends[0] + ends[1]) / 2 - viewpoint
        distance = np.linalg.norm(offset, axis=1)
        # A path bends little within a burst; 5 cm cover that.
        reach = self._radius + spread + np.linalg.norm(ends[1] - ends[0], axis=1) / 2 + 0.05
        close = np.flatnonzero(distance - reach < REACH_M)
        least = np.where(distance <= reach, -2.0 * distance, np.sqrt(np.maximum(distance**2 - reach**2, 0)))
        target, least, reach = offset[close], least[close], reach[close]
        cone = np.arcsin(np.clip(reach / np.maximum(distance[close], 1e-9), 0, 1))
        cone[distance[close] <= reach] = np.pi
        rays, found = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
        for begin in range(0, len(directions), _BLOCK):
            block = directions[begin : begin + _BLOCK]
            axis = block.mean(axis=0)
            axis /= max(float(np.linalg.norm(axis)), 1e-9)
            width = np.arccos(np.clip((block @ axis).min(), -1, 1))
            apart = np.arccos(np.clip(target @ axis / np.maximum(distance[close], 1e-9), -1, 1))
            some = np.flatnonzero(apart <= cone + width + 1e-3)
            if not len(some):
                continue
            hit_mover, hit_ray = np.nonzero(target[some] @ block.T >= least[some, None] - 1e-6)
            rays.append(hit_ray + begin)
            found.append(close[some[hit_mover]])
        return np.concatenate(rays), np.concatenate(found)

    def _poses(self, mover: NDArray[np.intp], t_ns: NDArray[np.int64]) -> tuple[Array, Array]:
        """Rotations (K, 3, 3) and positions (K, 3) of movers at times, linear between a path's samples."""
        i = np.clip(np.searchsorted(self._t_ns, t_ns, side="right") - 1, 0, len(self._t_ns) - 2)
        share = ((t_ns - self._t_ns[i]) / (self._t_ns[i + 1] - self._t_ns[i]))[:, None]
        position = (1 - share) * self._position[mover, i] + share * self._position[mover, i + 1]
        rotation = (1 - share) * self._rotation[mover, i] + share * self._rotation[mover, i + 1]
        return matrix_from_quaternion(rotation), position
