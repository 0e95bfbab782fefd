"""Rays against a world in motion: each ray meets every mover where it is at the ray's own time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.artifacts.open3d import import_open3d
from card.geometry import Trajectory
from card.simulation.mesh import Mesh, join

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mover:
    """A rigid body and its path: ``world_from_body`` over the whole drive."""

    mesh: Mesh
    path: Trajectory


@dataclass(frozen=True)
class Hits:
    """What rays met.

    distance : (N,) m, inf for nothing.  triangle : (N,) int64 into `Tracer.all`, -1 for nothing.
    barycentric : (N, 2) weights of the triangle's second and third corner.  normal : (N, 3) in world.
    """

    distance: Array
    triangle: NDArray[np.int64]
    barycentric: NDArray[np.float32]
    normal: NDArray[np.float32]


class Scene:
    """One mesh to cast rays at (Embree through Open3D, one thread)."""

    def __init__(self, mesh: Mesh) -> None:
        o3d = import_open3d()
        self._tensor = o3d.core.Tensor
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            self._tensor(mesh.vertices.astype(np.float32)), self._tensor(mesh.triangles.astype(np.uint32))
        )

    def cast(self, origins: ArrayLike, directions: ArrayLike) -> Hits:
        """Hits of rays (N, 3), directions of unit length, all in the mesh's frame."""
        rays = np.concatenate(np.broadcast_arrays(origins, directions), axis=1).astype(np.float32)
        found = self._scene.cast_rays(self._tensor(rays), nthreads=1)
        triangle = found["primitive_ids"].numpy()
        return Hits(
            found["t_hit"].numpy().astype(np.float64),
            np.where(triangle == np.iinfo(np.uint32).max, -1, triangle.astype(np.int64)),
            found["primitive_uvs"].numpy(),
            found["primitive_normals"].numpy(),
        )


class Tracer:
    """The static world and all movers.

    all : every body's mesh in one, static first, for looking up attributes of the triangle that was hit.
    """

    def __init__(self, static: Mesh, movers: Sequence[Mover]) -> None:
        self.all = join([static, *(m.mesh for m in movers)])
        self._static = Scene(static)
        self._movers = [(m, Scene(m.mesh), m.mesh.radius()) for m in movers]
        counts = [len(static.triangles), *(len(m.mesh.triangles) for m in movers)]
        self._first = np.cumsum([0, *counts])
        self.static_triangles = len(static.triangles)

    def cast(self, origins: Array, directions: Array, t_ns: NDArray[np.int64]) -> Hits:
        """First hits of rays (N, 3) in world, directions of unit length, fired at times t_ns (N,)."""
        hits = self._static.cast(origins, directions)
        centre = origins.mean(axis=0)
        spread = float(np.linalg.norm(origins - centre, axis=1).max())
        for index, (mover, scene, radius) in enumerate(self._movers):
            ends = mover.path.at(np.array([t_ns.min(), t_ns.max()]))[:, :3, 3]
            reach = radius + spread + float(np.linalg.norm(ends[1] - ends[0]))
            chosen = _towards(ends.mean(axis=0) - centre, reach, directions)
            if len(chosen):
                self._cast_mover(
                    mover, scene, int(self._first[index + 1]), origins, directions, t_ns, chosen, hits
                )
        return hits

    def uv(self, hits: Hits, chosen: NDArray[np.intp]) -> NDArray[np.float32]:
        """Texture coordinates (K, 2) of the chosen hits."""
        corners = self.all.uv[self.all.triangles[hits.triangle[chosen]]]
        b = hits.barycentric[chosen]
        weights = np.stack([1 - b[:, 0] - b[:, 1], b[:, 0], b[:, 1]], axis=1)
        return np.asarray(np.einsum("kc,kcx->kx", weights, corners))

    def _cast_mover(
        self,
        mover: Mover,
        scene: Scene,
        first: int,
        origins: Array,
        directions: Array,
        t_ns: NDArray[np.int64],
        chosen: NDArray[np.intp],
        hits: Hits,
    ) -> None:
        times, inverse = np.unique(t_ns[chosen], return_inverse=True)
        pose = mover.path.at(times)[inverse]
        rotation, position = pose[:, :3, :3], pose[:, :3, 3]
        local = scene.cast(
            np.einsum("kij,ki->kj", rotation, origins[chosen] - position),
            np.einsum("kij,ki->kj", rotation, directions[chosen]),
        )
        nearer = local.distance < hits.distance[chosen]
        winners = chosen[nearer]
        hits.distance[winners] = local.distance[nearer]
        hits.triangle[winners] = local.triangle[nearer] + first
        hits.barycentric[winners] = local.barycentric[nearer]
        hits.normal[winners] = np.einsum("kij,kj->ki", rotation[nearer], local.normal[nearer])


def _towards(offset: Array, reach: float, directions: Array) -> NDArray[np.intp]:
    """Indices of the directions (N, 3) that may meet a sphere of radius ``reach`` at ``offset`` (3,)."""
    distance = float(np.linalg.norm(offset))
    if distance <= reach:
        return np.arange(len(directions))
    return np.flatnonzero(directions @ offset >= np.sqrt(distance**2 - reach**2))
