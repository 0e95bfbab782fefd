"""Points of the ground truth against the mesh of a simulated drive."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.open3d import import_open3d

Array = NDArray[np.float64]

#: A point is occluded if the mesh lies nearer to the camera by more than this, m plus a share of the range:
#: at a grazing angle a few millimetres across the surface are many along the ray.
OCCLUDED_M, OCCLUDED_SHARE = 0.1, 0.02
#: Edges of the bins in which errors along rays are compared: range, m, and incidence, degrees.
RANGES_M = (0.0, 5.0, 10.0, 20.0, 40.0, 120.0)
INCIDENCES_DEG = (0.0, 60.0, 75.0, 85.0, 90.0)


@dataclass(frozen=True)
class RayErrors:
    """Of points that the camera sees: error (N,) along its ray, m; range (N,), m; incidence (N,), degrees."""

    error: Array
    range: Array
    incidence: Array

    def bins(self) -> NDArray[np.int64]:
        """(N,) number of the bin of range and incidence."""
        row = np.digitize(self.range, RANGES_M)
        return row * (len(INCIDENCES_DEG) + 1) + np.digitize(self.incidence, INCIDENCES_DEG)


class Mesh:
    """The static mesh of a drive's truth."""

    def __init__(self, world: Path) -> None:
        o3d = import_open3d()
        with np.load(world) as mesh:
            vertices = o3d.core.Tensor(mesh["vertices"].astype(np.float32))
            triangles = o3d.core.Tensor(mesh["triangles"].astype(np.uint32))
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(vertices, triangles)

    def distance(self, points: Array) -> Array:
        """Distance (N,) in metres of world points (N, 3) to the nearest surface."""
        o3d = import_open3d()
        found = self._scene.compute_distance(o3d.core.Tensor(points.astype(np.float32)))
        return np.asarray(found.numpy(), np.float64)

    def occluded(self, camera: Array, points: Array) -> NDArray[np.bool_]:
        """Whether the mesh hides each world point (N, 3) from the camera (3,)."""
        hit, _, distance = self._cast(camera, points)
        return np.asarray(hit < distance * (1 - OCCLUDED_SHARE) - OCCLUDED_M)

    def ray_errors(self, camera: Array, points: Array) -> RayErrors:
        """How far the world points (N, 3) lie from the surface along the camera's rays, where it is seen."""
        hit, cosine, distance = self._cast(camera, points)
        error = distance - hit
        seen = np.abs(error) < distance * OCCLUDED_SHARE + OCCLUDED_M
        incidence = np.degrees(np.arccos(np.clip(cosine[seen], 0, 1)))
        return RayErrors(error[seen], distance[seen], incidence)

    def _cast(self, camera: Array, points: Array) -> tuple[Array, Array, Array]:
        """Range of the mesh (N,), |cosine| of the ray to its normal (N,) and range of the point (N,)."""
        o3d = import_open3d()
        rays = points - camera
        distance = np.linalg.norm(rays, axis=1)
        rays = rays / distance[:, None]
        cast = np.concatenate([np.broadcast_to(camera, rays.shape), rays], axis=1).astype(np.float32)
        found: Any = self._scene.cast_rays(o3d.core.Tensor(cast))
        normals = found["primitive_normals"].numpy().astype(np.float64)
        hit = found["t_hit"].numpy().astype(np.float64)
        return hit, np.abs((normals * rays).sum(axis=1)), distance


def floor_ratio(kept: RayErrors, raw: RayErrors) -> float:
    """Median error of kept points over that of raw ones at the same ranges and incidences.

    Raw points of single sweeps with true poses carry the sensor's noise and nothing else.
    """
    ours, theirs = kept.bins(), raw.bins()
    kept_sum = floor_sum = 0.0
    for bin_ in np.unique(ours):
        of_raw = np.abs(raw.error[theirs == bin_])
        if len(of_raw) >= 50:
            of_kept = np.abs(kept.error[ours == bin_])
            kept_sum += len(of_kept) * float(np.median(of_kept))
            floor_sum += len(of_kept) * float(np.median(of_raw))
    return kept_sum / floor_sum if floor_sum else float("nan")
