"""Rays against a world in motion: each ray meets every mover where it is at the ray's own time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.artifacts.open3d import import_open3d
from card.geometry import Trajectory
from card.simulation.gallery import Gallery
from card.simulation.mesh import Mesh, join

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mover:
    """A rigid body and its path ``world_from_body``; all movers of a world share their paths' times."""

    mesh: Mesh
    path: Trajectory


@dataclass(frozen=True)
class Hits:
    """What rays met.

    distance : (N,) m, inf for nothing.  triangle : (N,) int32 into the mesh, -1 for nothing.
    barycentric : (N, 2) weights of the triangle's second and third corner.  normal : (N, 3), unit.
    """

    distance: NDArray[np.float32]
    triangle: NDArray[np.int32]
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

    def first(self, rays: NDArray[np.float32]) -> Hits:
        """Hits of rays (N, 6): origin and unit direction, in the mesh's frame."""
        found = self._scene.cast_rays(self._tensor.from_numpy(rays), nthreads=1)
        return Hits(
            found["t_hit"].numpy(),
            found["primitive_ids"].numpy().view(np.int32),  # what met nothing has the last id, as -1 is
            found["primitive_uvs"].numpy(),
            found["primitive_normals"].numpy(),
        )

    def cast(self, origins: ArrayLike, directions: ArrayLike) -> Hits:
        """Hits of rays (N, 3), directions of unit length, all in the mesh's frame."""
        rays = np.concatenate(np.broadcast_arrays(origins, directions), axis=1).astype(np.float32)
        return self.first(rays)

    def blocked(self, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether rays (N, 6) meet anything within their length (N,)."""
        blocked = self._scene.test_occlusions(self._tensor.from_numpy(rays), tfar=1.0, nthreads=1)
        return np.asarray(blocked.numpy())

    def distance(self, points: Array) -> Array:
        """Distance (N,) of points (N, 3) to the nearest surface, m."""
        near = self._scene.compute_distance(self._tensor(points.astype(np.float32)), nthreads=1)
        return np.asarray(near.numpy(), dtype=np.float64)


class Tracer:
    """The static world and all movers.

    all : every body's mesh in one, static first, to look up what was hit.  static : the static scene.
    first_triangle : (M,) of each mover in `all`.
    """

    def __init__(self, static: Mesh, movers: Sequence[Mover]) -> None:
        self.all = join([static, *(m.mesh for m in movers)])
        self.static, self.movers = Scene(static), list(movers)
        self.static_triangles = len(static.triangles)
        sizes = [self.static_triangles, *(len(m.mesh.triangles) for m in movers)]
        self.first_triangle = np.cumsum(sizes)[:-1]
        self._gallery = Gallery([m.mesh for m in movers], [m.path for m in movers]) if movers else None

    def cast(self, origins: Array, directions: Array, t_ns: NDArray[np.int64]) -> Hits:
        """First hits of rays (N, 3) in world, directions of unit length, fired at times t_ns (N,)."""
        hits = self.static.cast(origins, directions)
        if self._gallery is None:
            return hits
        found = self._gallery.cast(origins, directions, t_ns)
        # Far to near, so that the nearest mover is written last.
        order = np.argsort(-found.distance, kind="stable")
        order = order[found.distance[order] < hits.distance[found.ray[order]]]
        ray = found.ray[order]
        hits.distance[ray] = found.distance[order]
        hits.triangle[ray] = found.triangle[order] + self.static_triangles
        hits.barycentric[ray] = found.barycentric[order]
        hits.normal[ray] = found.normal[order]
        return hits
