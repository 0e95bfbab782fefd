"""The road: one height function over road coordinates for mesh, wheels and truth."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.geometry import apply, inverse, transform
from card.simulation.centreline import CentreLine
from card.simulation.irregularities import Irregularity
from card.simulation.spectrum import Roughness

Array = NDArray[np.float64]

CROWN_SLOPE = 0.025
#: Curvature (1/m) at which a bend is banked to 76 % of what is built.
BANK_CURVATURE = 0.012
#: Half the distance between the ruts of an unpaved track, and how wide they are (one sigma).
_RUT_OFFSET_M, _RUT_WIDTH_M = 0.84, 0.3
KERB_RUN_M = 0.03


@dataclass(frozen=True)
class CrossSection:
    """Half of a road's profile, mirrored; metres.

    half_width : carriageway from its middle to its edge.
    side_width : sidewalk or verge beyond.
    kerb : step up at the edge; 0 for none.
    side_slope : rise of the side per metre outward.
    lane : offset of the right lane's middle.
    paved : asphalt or gravel.
    bank : largest cross slope in a bend.
    ruts : depth of two wheel tracks around ``lane``.
    """

    half_width: float
    side_width: float
    kerb: float
    side_slope: float
    lane: float
    paved: bool
    bank: float = 0.0
    ruts: float = 0.0

    @property
    def reach(self) -> float:
        """Offset at which the road's own mesh ends."""
        return self.half_width + self.side_width

    @property
    def tilt_m(self) -> float:
        """By how much a fully banked road's edges are raised and lowered."""
        return self.bank * self.half_width

    def height(self, d: Array, curvature: ArrayLike = 0.0) -> Array:
        """Crown, bank, kerb and side (...) in metres, zero in the middle of the road.

        curvature : (...) of the centre line, 1/m, left positive. With a share q = tanh(curvature /
        BANK_CURVATURE), the road rises by q ``bank`` per metre outward in a bend, while 1 - q^2 of the
        crown is left: fully banked it is a plane.
        """
        offset = np.abs(d)
        road = np.minimum(offset, self.half_width)
        q = np.tanh(np.asarray(curvature) / BANK_CURVATURE) if self.bank else np.zeros(())
        crown = -CROWN_SLOPE * (np.hypot(road, 0.25) - 0.25) * (1 - q * q)
        bank = q * self.bank * np.copysign(road, d)
        if self.ruts:
            for middle in (self.lane - _RUT_OFFSET_M, self.lane + _RUT_OFFSET_M):
                crown = crown - self.ruts * np.exp(-0.5 * ((d - middle) / _RUT_WIDTH_M) ** 2)
        kerb = self.kerb * np.clip((offset - self.half_width) / KERB_RUN_M, 0.0, 1.0)
        return crown + bank + kerb + self.side_slope * np.maximum(offset - self.half_width, 0.0)


@dataclass(frozen=True)
class Hills:
    """Slow swell of the land (m) over map coordinates: a few long waves."""

    amplitude: Array
    wave: Array
    phase: Array

    def height(self, xy: Array) -> Array:
        """Heights (...) of points (..., 2)."""
        return np.cos(xy @ self.wave.T + self.phase) @ self.amplitude


@dataclass(frozen=True)
class Road:
    """Centre line, cross-section, hills, roughness and irregularities, placed in ``world``.

    Road coordinates are (s, d): arc length of the centre line and offset to the right, metres.
    """

    line: CentreLine
    section: CrossSection
    hills: Hills
    roughness: Roughness
    irregularities: tuple[Irregularity, ...]
    world_from_map: Array

    def placed(self, world_from_map: Array) -> "Road":
        """The same road with its map put elsewhere: a shift and a turn about z."""
        return replace(self, world_from_map=world_from_map)

    def xyz(self, s: ArrayLike, d: ArrayLike) -> Array:
        """Surface points (..., 3) in world at road coordinates (...)."""
        points = self.bare(s, d)
        points[..., 2] += self.raised(s, d)
        return points

    def bare(self, s: ArrayLike, d: ArrayLike) -> Array:
        """Surface points (..., 3) in world at road coordinates (...), without irregularities."""
        s, d = np.broadcast_arrays(np.asarray(s, dtype=np.float64), np.asarray(d, dtype=np.float64))
        xy = self.line.offset(s, d)
        on_road = np.clip((self.section.half_width + 0.5 - np.abs(d)) / 0.5, 0.15, 1.0)
        z = self.hills.height(xy) + on_road * self.roughness.height(s, d)
        z += self.section.height(d, self.line.curvature(s) if self.section.bank else 0.0)
        return _transform(self.world_from_map, np.concatenate([xy, z[..., None]], axis=-1))

    def raised(self, s: ArrayLike, d: ArrayLike) -> Array:
        """What irregularities add to the height (...) at road coordinates (...), m."""
        s, d = np.broadcast_arrays(np.asarray(s, dtype=np.float64), np.asarray(d, dtype=np.float64))
        z = np.zeros(s.shape)
        for thing in self.irregularities:
            s_min, s_max, d_min, d_max = thing.extent
            local = self.near(s, thing)
            within = (local > s_min) & (local < s_max) & (d > d_min) & (d < d_max)
            if within.any():
                z[within] += thing.height(local[within], d[within])
        return z

    def near(self, s: Array, thing: Irregularity) -> Array:
        """Arc lengths (...) counted so that, on a closed road, they are nearest to ``thing``'s own."""
        if not self.line.closed:
            return s
        half = self.line.length / 2
        return thing.s + np.mod(s - thing.s + half, self.line.length) - half

    def height(self, xy: Array, guess: ArrayLike) -> Array:
        """World z (...) of the surface at world points xy (..., 2), near arc lengths ``guess``."""
        s, d = self.coordinates(xy, guess)
        return self.xyz(s, d)[..., 2]

    def coordinates(self, xy: Array, guess: ArrayLike) -> tuple[Array, Array]:
        """Road coordinates of world points (..., 2), near arc lengths ``guess``."""
        flat = np.concatenate([xy, np.zeros((*xy.shape[:-1], 1))], axis=-1)
        return self.line.project(_transform(inverse(self.world_from_map), flat)[..., :2], guess)

    def land(self, xy: Array) -> Array:
        """World z (...) of the land beside the road at world points (..., 2): the hills, without the road."""
        flat = np.concatenate([xy, np.zeros((*xy.shape[:-1], 1))], axis=-1)
        mapped = _transform(inverse(self.world_from_map), flat)[..., :2]
        return self.hills.height(mapped) + self.world_from_map[2, 3]

    def pose(self, s: ArrayLike, d: ArrayLike, turn: ArrayLike = 0.0) -> Array:
        """``world_from_thing`` (..., 4, 4), upright on the surface.

        Its y points along the road, turned left by ``turn`` rad.
        """
        tangent = self.line.at(s, 1) @ self.world_from_map[:2, :2].T
        yaw = np.arctan2(-tangent[..., 0], tangent[..., 1]) + np.asarray(turn, dtype=np.float64)
        position = self.xyz(s, d)
        half = np.broadcast_to(0.5 * yaw, position.shape[:-1])
        zero = np.zeros_like(half)
        return transform(position, np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1))


def hills(rng: np.random.Generator, swell: float = 0.25) -> Hills:
    """Waves of 90 to 250 m in all directions, ``swell`` m high each."""
    angle, length = rng.uniform(0, 2 * np.pi, 4), rng.uniform(90, 250, 4)
    wave = 2 * np.pi / length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Hills(swell * rng.uniform(0.5, 1, 4), wave, rng.uniform(0, 2 * np.pi, 4))


def _transform(matrix: Array, points: Array) -> Array:
    return apply(matrix, points.reshape(-1, 3)).reshape(points.shape)
