"""What light falls on a surface and what the sky looks like, by day and at night.

Light is in units of what a white surface sends back in full sun, 100 000 lx.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from card.geometry import apply
from card.simulation.bodies import EGO_HEADLIGHTS_M, HEADLIGHTS_M
from card.simulation.compiled import compiled
from card.simulation.snapshot import Sight, Snapshot
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.world import World

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_SUN_LX = 1e5
_SUN, _SKY_LIGHT = np.array([1.05, 1.0, 0.9], np.float32), np.array([0.36, 0.40, 0.47], np.float32)
_MOON = np.array([3e-6, 3e-6, 3.5e-6], np.float32)
_CITY_GLOW = np.array([1.2e-5, 1.0e-5, 0.9e-5], np.float32)
STREET_LAMP_CD, HEADLIGHT_CD = 5000.0, 30_000.0
_STREET_LAMP_TONE = np.array([1.0, 0.82, 0.58], np.float32)
_HEADLIGHT_TONE = np.array([1.0, 0.96, 0.88], np.float32)
_STREET_LAMP_REACH_M, _HEADLIGHT_REACH_M = 35.0, 70.0
#: A low beam: spread to the sides, aim below the horizon and spread below that; what gets above the horizon.
_BEAM_SIDE, _BEAM_DOWN, _BEAM_HEIGHT = np.radians((16.0, 2.0, 4.0)).astype(np.float32)
_BEAM_ABOVE = np.float32(0.08)
_EMISSION = np.array([LOOKS[s].emission for s in Surface], np.float32)
#: Light starts this far off a surface, so that the surface does not shade itself.
_LIFT_M = np.float32(0.02)
_FAR_M = np.float32(400.0)
#: Less light than this, 0.02 lx, is not followed.
_LEAST = np.float32(2e-7)


class Light(Protocol):
    """The light of one moment."""

    def shine(self, albedo: Image, surface: NDArray[np.uint8], sight: Sight, snapshot: Snapshot) -> None:
        """Turn the albedo (N, 3) of surfaces (N,) in sight into what they send back and send out."""

    def sky(self, rays: Image) -> Image:
        """Linear RGB (N, 3) of the sky along unit vectors (N, 3) in world."""


@dataclass(frozen=True)
class Daylight:
    """The sun, which throws shadows, and a clear sky.  sun : (3,) unit vector towards it."""

    sun: Array

    def shine(self, albedo: Image, surface: NDArray[np.uint8], sight: Sight, snapshot: Snapshot) -> None:
        sun = self.sun.astype(np.float32)
        lit, ways = _sunlit(sight.point, sight.normal, sight.triangle, sun)
        arrives = np.zeros(len(albedo), np.bool_)
        arrives[lit] = snapshot.sees(ways)
        _sum_up(albedo, sight.normal, sun, arrives, _SUN, _SKY_LIGHT)

    def sky(self, rays: Image) -> Image:
        up = np.clip(rays[:, 2:], 0, 1) ** np.float32(0.6)
        blue, haze = np.array([0.22, 0.36, 0.62], np.float32), np.array([0.62, 0.66, 0.70], np.float32)
        glow = np.clip(np.einsum("ni,i->n", rays, self.sun.astype(np.float32)), 0, 1)[:, None] ** 8
        return np.asarray(haze + up * (blue - haze) + np.float32(0.3) * glow * glow * glow)


@dataclass(frozen=True)
class Lamp:
    """A lamp: where it is (3,), the axes right, ahead and up of a headlight as columns (3, 3), its light."""

    place: Array
    axes: Array
    candela: float
    tone: Image
    reach_m: float
    is_headlight: bool


@dataclass(frozen=True)
class NightLight:
    """Street lamps and headlights, which throw shadows, and a little of the moon and the city.

    moon : (3,) unit vector towards it.
    """

    moon: Array
    lamps: list[Lamp]

    def shine(self, albedo: Image, surface: NDArray[np.uint8], sight: Sight, snapshot: Snapshot) -> None:
        light = np.ones_like(albedo)
        everywhere = np.ones(len(albedo), np.bool_)
        _sum_up(light, sight.normal, self.moon.astype(np.float32), everywhere, _MOON, _CITY_GLOW)
        for lamp in self.lamps:
            lit, strength, ways = _lamplit(
                sight.point,
                sight.normal,
                sight.triangle,
                lamp.place.astype(np.float32),
                lamp.axes.astype(np.float32),
                np.float32(lamp.candela / _SUN_LX),
                np.float32(lamp.reach_m),
                lamp.is_headlight,
            )
            light[lit] += (strength * snapshot.sees(ways))[:, None] * lamp.tone
        albedo *= light + _EMISSION[surface][:, None]

    def sky(self, rays: Image) -> Image:
        up = np.clip(rays[:, 2:], 0, 1) ** np.float32(0.6)
        return np.asarray(_CITY_GLOW * (np.float32(1.6) - np.float32(1.4) * up), np.float32)


def light_at(world: World, t_ns: int) -> Light:
    """The light of a world's drive at a time."""
    if not world.drive.night:
        return Daylight(world.sun)
    rig = world.path.at(t_ns)
    street = [
        Lamp(place, np.eye(3), STREET_LAMP_CD, _STREET_LAMP_TONE, _STREET_LAMP_REACH_M, False)
        for place in world.lamps
        if np.linalg.norm(place - rig[:3, 3]) < 3 * _STREET_LAMP_REACH_M
    ]
    cars = [(world.movers[k].path.at(t_ns), HEADLIGHTS_M) for k in world.cars]
    # One lamp in the middle of each pair: what they light hardly differs.
    head = [
        Lamp(
            apply(pose, places.mean(axis=0, keepdims=True))[0],
            pose[:3, :3],
            HEADLIGHT_CD,
            _HEADLIGHT_TONE,
            _HEADLIGHT_REACH_M,
            True,
        )
        for pose, places in [(rig, EGO_HEADLIGHTS_M), *cars]
        if np.linalg.norm(pose[:3, 3] - rig[:3, 3]) < 2 * _HEADLIGHT_REACH_M
    ]
    return NightLight(world.sun, street + head)


@compiled
def low_beam(right: np.float32, ahead: np.float32, up: np.float32) -> np.float32:
    """Share of a headlight's full intensity along a unit vector in its own axes."""
    if ahead <= 0:
        return np.float32(0)
    side = right / ahead / _BEAM_SIDE
    below = min(up + _BEAM_DOWN, np.float32(0)) / _BEAM_HEIGHT
    share = np.exp(-side * side - below * below)
    return share * _BEAM_ABOVE if up > 0 else share


@compiled
def _lamplit(
    point: Image,
    normal: Image,
    triangle: NDArray[np.int32],
    place: Image,
    axes: Image,
    strength: np.float32,
    reach: np.float32,
    is_headlight: bool,
) -> tuple[NDArray[np.int64], Image, Image]:
    """Points (K,) that a lamp would light, how much (K,), and the way (K, 6) its light has to be free."""
    lit = np.empty(len(point), np.int64)
    light = np.empty(len(point), np.float32)
    ways = np.empty((len(point), 6), np.float32)
    count = 0
    for i in range(len(point)):
        if triangle[i] < 0:
            continue
        x, y, z = point[i, 0] - place[0], point[i, 1] - place[1], point[i, 2] - place[2]
        squared = max(x * x + y * y + z * z, np.float32(0.25))
        facing = -(x * normal[i, 0] + y * normal[i, 1] + z * normal[i, 2])
        if squared > reach * reach or facing <= 0:
            continue
        distance = np.sqrt(squared)
        if is_headlight:
            right = (x * axes[0, 0] + y * axes[1, 0] + z * axes[2, 0]) / distance
            ahead = (x * axes[0, 1] + y * axes[1, 1] + z * axes[2, 1]) / distance
            up = (x * axes[0, 2] + y * axes[1, 2] + z * axes[2, 2]) / distance
            share = low_beam(right, ahead, up)
        else:
            share = max(-z / distance, np.float32(0))
        arriving = strength * share * facing / distance / squared
        if arriving < _LEAST:
            continue
        lit[count], light[count] = i, arriving
        for k in range(3):
            start = point[i, k] + _LIFT_M * normal[i, k]
            ways[count, k] = start
            # The way ends short of the lamp's own housing.
            ways[count, 3 + k] = np.float32(0.97) * (place[k] - start)
        count += 1
    return lit[:count], light[:count], ways[:count]


@compiled
def _sunlit(
    point: Image, normal: Image, triangle: NDArray[np.int32], sun: Image
) -> tuple[NDArray[np.int64], Image]:
    """Points (K,) that face the sun, and the way (K, 6) its light has to be free."""
    lit = np.empty(len(point), np.int64)
    ways = np.empty((len(point), 6), np.float32)
    count = 0
    for i in range(len(point)):
        facing = normal[i, 0] * sun[0] + normal[i, 1] * sun[1] + normal[i, 2] * sun[2]
        if triangle[i] < 0 or facing <= 0:
            continue
        lit[count] = i
        for k in range(3):
            ways[count, k] = point[i, k] + _LIFT_M * normal[i, k]
            ways[count, 3 + k] = _FAR_M * sun[k]
        count += 1
    return lit[:count], ways[:count]


@compiled
def _sum_up(
    albedo: Image, normal: Image, sun: Image, arrives: NDArray[np.bool_], direct: Image, ambient: Image
) -> None:
    """Multiply albedo (N, 3) by direct light where it arrives and light from all over the sky."""
    for i in range(len(albedo)):
        facing = normal[i, 0] * sun[0] + normal[i, 1] * sun[1] + normal[i, 2] * sun[2]
        straight = max(facing, np.float32(0)) if arrives[i] else np.float32(0)
        around = np.float32(0.55) + np.float32(0.45) * normal[i, 2]
        for k in range(3):
            albedo[i, k] *= straight * direct[k] + around * ambient[k]
