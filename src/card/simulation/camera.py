"""A camera on the car: one ray a pixel through its distorted lens."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel
from card.simulation.raycast import Scene, Tracer
from card.simulation.shading import Shader, developed, sky

Array = NDArray[np.float64]

NOISE = 1.2
_HOOD = np.array([0.022, 0.025, 0.03])


@dataclass(frozen=True)
class Picture:
    """One exposure.

    rgb : (H, W, 3) uint8.  depth : (H, W) m along the optical axis, inf for sky, NaN for our own car.
    thing : (H, W) int32, index of what a label is drawn around, -1 for none.
    """

    rgb: NDArray[np.uint8]
    depth: Array
    thing: NDArray[np.int32]


class Camera:
    """One camera of the car; its pixels' rays and the view of the own hood are worked out once."""

    def __init__(self, model: CameraModel, rig_from_camera: Array, ego: Scene, sun: Array) -> None:
        self.model, self._pose, self._sun = model, rig_from_camera, sun
        rays = model.rays(_pixel_grid(model))
        self._cosine = 1 / np.linalg.norm(rays, axis=1)
        self._in_rig = (rays * self._cosine[:, None]) @ rig_from_camera[:3, :3].T
        own = ego.cast(np.broadcast_to(rig_from_camera[:3, 3], rays.shape), self._in_rig)
        self._own = own.triangle >= 0
        facing = np.sum(own.normal * self._in_rig, axis=1, keepdims=True)
        self._own_normal = np.where(facing > 0, -own.normal, own.normal)

    def shoot(
        self, tracer: Tracer, shader: Shader, world_from_rig: Array, t_ns: int, rng: np.random.Generator
    ) -> Picture:
        """The picture taken at ``t_ns`` from ``world_from_rig`` (4, 4); the shutter is global and short."""
        rotation = world_from_rig[:3, :3]
        origin = world_from_rig @ self._pose[:, 3]
        rays = self._in_rig @ rotation.T
        outside = ~self._own
        seen = rays[outside]
        origins = np.broadcast_to(origin[:3], seen.shape)
        hits = tracer.cast(origins, seen, np.full(len(seen), t_ns, np.int64))
        count = len(rays)
        linear = np.empty((count, 3), np.float32)
        linear[outside] = shader.colours(hits, origins, seen, self.model.fx)
        linear[self._own] = self._hood(rays[self._own], self._own_normal[self._own] @ rotation.T)
        thing, depth = np.full(count, -1, np.int32), np.full(count, np.nan)
        met = hits.triangle >= 0
        thing[np.flatnonzero(outside)[met]] = tracer.all.thing[hits.triangle[met]]
        depth[outside] = hits.distance * self._cosine[outside]
        shape = self.model.height, self.model.width
        noise = rng.standard_normal((count, 3), np.float32) * np.float32(NOISE)
        return Picture(
            developed(linear, noise).reshape(*shape, 3), depth.reshape(shape), thing.reshape(shape)
        )

    def _hood(self, rays: Array, normal: Array) -> Array:
        mirrored = rays - 2 * np.sum(rays * normal, axis=1, keepdims=True) * normal
        lit = np.maximum(normal @ self._sun, 0)[:, None]
        return _HOOD * (0.4 + lit) + 0.12 * sky(mirrored, self._sun)


def _pixel_grid(model: CameraModel) -> Array:
    v, u = np.mgrid[0 : model.height, 0 : model.width]
    return np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64)
