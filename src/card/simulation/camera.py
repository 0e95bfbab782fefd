"""A camera on the car: one ray a pixel through its distorted lens, light on a moving sensor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import inverse
from card.simulation.blur import blurred, image_motion
from card.simulation.compiled import compiled
from card.simulation.exposure import DAY, NIGHT
from card.simulation.lens import lens_of
from card.simulation.lighting import Light, light_at
from card.simulation.raycast import Scene, Tracer
from card.simulation.shading import Shader
from card.simulation.snapshot import Snapshot
from card.simulation.world import World

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_HOOD, _HOOD_SHINE = np.array([0.022, 0.025, 0.03], np.float32), np.float32(0.12)


@dataclass(frozen=True)
class Picture:
    """One exposure.

    rgb : (H, W, 3) uint8.  depth : (H, W) m along the optical axis, inf for sky, NaN for our own car.
    thing : (H, W) int32, index of what a label is drawn around, -1 for none.
    """

    rgb: NDArray[np.uint8]
    depth: Image
    thing: NDArray[np.int32]


@dataclass(frozen=True)
class View:
    """What arrives at a lens while the shutter is open, before it blurs.

    light : (H, W, 3).  motion : (H, W, 2), how far it moves, px.  depth, thing : as in `Picture`.
    """

    light: Image
    motion: Image
    depth: Image
    thing: NDArray[np.int32]


class Camera:
    """One camera of a world's car; the view of the own hood is worked out once."""

    def __init__(self, world: World, tracer: Tracer, shader: Shader, ego: Scene, name: str) -> None:
        self._world, self._tracer, self._shader = world, tracer, shader
        self.lens, self._pose = lens_of(world.rig.cameras[name]), world.rig.rig_from[name]
        self.exposure = NIGHT if world.drive.night else DAY
        self._thing = tracer.all.thing
        shape = self.lens.length.shape
        self._own, self._own_normal = np.zeros(shape, np.bool_), np.zeros((*shape, 3), np.float32)
        for rows in self.lens.bands():
            rays = self._turned(rows, self._pose[:3, :3])
            own = ego.cast(self._pose[:3, 3], rays.reshape(-1, 3))
            toward = np.where(np.einsum("ni,ni->n", own.normal, rays.reshape(-1, 3)) > 0, -1, 1)
            self._own[rows] = (own.triangle >= 0).reshape(rays.shape[:2])
            self._own_normal[rows] = (own.normal * toward[:, None]).reshape(rays.shape)

    def shoot(self, t_ns: int, rng: np.random.Generator) -> Picture:
        """The picture whose exposure has its middle at ``t_ns``."""
        view = self.view(t_ns)
        smooth = blurred(view.light, view.motion, 64)
        rgb = np.empty(smooth.shape, np.uint8)
        for rows in self.lens.bands():
            rgb[rows] = self.exposure.taken(smooth[rows], self.lens.vignetting[rows], rng)
        return Picture(rgb, view.depth, view.thing)

    def view(self, t_ns: int) -> View:
        """Light, its motion, depth and things in the middle of an exposure."""
        half_ns = self.exposure.time_ns // 2
        before, now, after = (
            self._world.path.at(np.array([t_ns - half_ns, t_ns, t_ns + half_ns])) @ self._pose
        )
        snapshot = Snapshot(self._tracer, now[:3, 3], t_ns, half_ns)
        light = light_at(self._world, t_ns)
        way, turn = _movement(before, after)
        shape = self._own.shape
        view = View(
            np.empty((*shape, 3), np.float32),
            np.zeros((*shape, 2), np.float32),
            np.full(shape, np.nan, np.float32),
            np.full(shape, -1, np.int32),
        )
        for rows in self.lens.bands():
            self._fill(view, rows, snapshot, light, now, way, turn)
        return view

    def _fill(
        self, view: View, rows: slice, snapshot: Snapshot, light: Light, pose: Array, way: Array, turn: Array
    ) -> None:
        rays, own = self._turned(rows, pose[:3, :3]).reshape(-1, 3), self._own[rows].ravel()
        length = self.lens.length[rows].ravel()
        # A slice where all of the band looks outside: nothing is copied then.
        outside = np.flatnonzero(~own) if own.any() else slice(None)
        seen = rays[outside]
        sight = snapshot.look(pose[:3, 3], seen)
        colours, motion, depth, thing = (
            a[rows].reshape(len(rays), -1) for a in (view.light, view.motion, view.depth, view.thing)
        )
        colours[outside] = self._shader.colours(sight, seen, self.lens.model.fx, light, snapshot)
        near = length[outside] / sight.distance
        depth[outside, 0] = sight.distance / length[outside]
        thing[outside, 0] = np.where(sight.triangle < 0, -1, self._thing[sight.triangle])
        ways = -way.astype(np.float32)[None]
        moving, moved = snapshot.shift(sight)
        if len(moving):
            ways = np.repeat(ways, len(seen), axis=0)
            ways[moving] += moved @ pose[:3, :3].astype(np.float32)
        lens_rays, jacobian = (a[rows].reshape(len(rays), -1) for a in (self.lens.rays, self.lens.jacobian))
        motion[outside] = image_motion(
            lens_rays[outside], jacobian[outside], near, ways, turn.astype(np.float32)
        )
        if own.any():
            normal = self._own_normal[rows].reshape(-1, 3)[own] @ self._rig_turn(pose).T
            colours[own] = _hood(rays[own], normal, light)

    def _turned(self, rows: slice, rotation: Array) -> Image:
        """Unit rays (..., 3) of rows of pixels, turned by a rotation from the camera."""
        return _unit(self.lens.rays[rows], self.lens.length[rows], rotation.astype(np.float32))

    def _rig_turn(self, pose: Array) -> Image:
        return np.asarray(pose[:3, :3] @ self._pose[:3, :3].T, np.float32)


def _movement(before: Array, after: Array) -> tuple[Array, Array]:
    """How far a camera moves (3,) and turns (rotation vector, (3,)) in its own frame between two poses."""
    from scipy.spatial.transform import Rotation

    step = inverse(before) @ after
    return step[:3, 3], Rotation.from_matrix(step[:3, :3]).as_rotvec()


def _hood(rays: Image, normal: Image, light: Light) -> Image:
    mirrored = rays - 2 * np.einsum("ni,ni->n", rays, normal)[:, None] * normal
    sky = light.sky(mirrored)
    return np.asarray(_HOOD * sky.mean(axis=1, keepdims=True) * 2 + _HOOD_SHINE * sky)


@compiled
def _unit(rays: Image, length: Image, turn: Image) -> Image:
    out = np.empty((*length.shape, 3), np.float32)
    for i in range(length.shape[0]):
        for j in range(length.shape[1]):
            for k in range(3):
                along = rays[i, j, 0] * turn[k, 0] + rays[i, j, 1] * turn[k, 1] + turn[k, 2]
                out[i, j, k] = along / length[i, j]
    return out
