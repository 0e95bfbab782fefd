"""A spinning XT32: 32 channels a column, each ray at its own time against the moving world."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.recording.burst import Burst
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CHANNELS, LidarCorrections, lidar_elevations_rad
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.world import World

Array = NDArray[np.float64]

PERIOD_NS = 100_000_000
#: Time between two channels of a column (XT32 manual), range resolution and noise (one sigma), and reach.
CHANNEL_NS = 1512
RESOLUTION_M, NOISE_M, REACH_M = 0.004, 0.005, 120.0
_NEAREST_M = 0.05
_STEP_UNITS = 36000  # hundredths of a degree a revolution: what a packet can say
_REFLECTIVITY = np.array([LOOKS[s].reflectivity for s in Surface])
#: When in its period each unit passes azimuth zero: the spins are not synchronised.
SPIN_PHASE_NS = {"lidar_front": 13_000_000, "lidar_rear": 59_000_000}


@dataclass(frozen=True)
class BurstTruth:
    """What each point of a burst really met.

    dynamic : (N,) whether it moves.  range_m : (N,) true range.  surface : (N,) ids of `Surface`.
    """

    dynamic: NDArray[np.bool_]
    range_m: NDArray[np.float32]
    surface: NDArray[np.uint8]


def burst_starts(lidar: str, start_ns: int, duration_s: float) -> list[int]:
    """Starts (ns) of all whole revolutions of a LiDAR within a recording."""
    first = start_ns + SPIN_PHASE_NS[lidar]
    count = (start_ns + round(duration_s * 1e9) - first) // PERIOD_NS
    return [first + k * PERIOD_NS for k in range(count)]


def columns(count: int, number: int) -> tuple[NDArray[np.int64], Array]:
    """Firing times (C,) in ns after the burst's start and azimuths (C,) rad of revolution ``number``.

    The first column moves on from one revolution to the next, by whole hundredths of a degree, as far as
    the last one still fires before the next revolution starts.
    """
    step = _STEP_UNITS // count
    firing = -(-(CHANNELS - 1) * CHANNEL_NS * _STEP_UNITS // PERIOD_NS)
    units = number * 89 % (step - firing) + step * np.arange(count)
    return units * PERIOD_NS // _STEP_UNITS, np.radians(units / 100)


def directions(azimuth: Array, elevation: Array) -> Array:
    """Unit vectors (..., 3): x right, y ahead, azimuth clockwise from y seen from above."""
    flat = np.cos(elevation)
    return np.stack(
        np.broadcast_arrays(flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(elevation)), axis=-1
    )


class Lidar:
    """One LiDAR of a world's car."""

    def __init__(self, world: World, tracer: Tracer, ego: Scene, name: str) -> None:
        self.name, self._world, self._tracer, self._ego = name, world, tracer, ego
        self._errors: LidarCorrections = world.rig.lidar_corrections[name]

    def scan(self, t_ns: int, number: int) -> tuple[Burst, BurstTruth]:
        """Revolution ``number``, which starts at ``t_ns``; its noise is its own."""
        noise = self._world.rng(f"noise of {self.name} {number}")
        fired, azimuth = columns(self._world.scale.columns, number)
        ring = np.tile(np.arange(CHANNELS), len(fired))
        offset = fired.repeat(CHANNELS) + ring * CHANNEL_NS
        measured = (azimuth.repeat(CHANNELS), lidar_elevations_rad()[ring])
        true = directions(
            measured[0] + self._errors.channel_azimuth_offset_rad[ring],
            measured[1] + self._errors.channel_elevation_offset_rad[ring],
        )
        rig_from_lidar = self._world.rig.rig_from[self.name]
        in_rig = np.einsum("ij,nj->ni", rig_from_lidar[:3, :3], true)
        origins, rays = self._in_world(t_ns + fired, rig_from_lidar[:3, 3], in_rig)
        hits = self._tracer.cast(origins, rays, t_ns + offset)
        own = self._ego.cast(np.broadcast_to(rig_from_lidar[:3, 3], in_rig.shape), in_rig).distance

        distance = self._distance(hits.distance, ring, noise)
        back = np.flatnonzero((distance > _NEAREST_M) & (distance < REACH_M) & (own > hits.distance))
        triangle = hits.triangle[back]
        surface = self._tracer.all.surface[triangle]
        incidence = np.abs(np.sum(hits.normal[back] * rays[back], axis=1))
        points = distance[back, None] * directions(measured[0][back], measured[1][back])
        shine = 255 * _REFLECTIVITY[surface] * (0.3 + 0.7 * incidence)
        burst = Burst(
            t_ns,
            points,
            np.clip(np.rint(shine), 1, 255).astype(np.uint8),
            ring[back].astype(np.uint8),
            offset[back].astype(np.uint32),
        )
        dynamic = triangle >= self._tracer.static_triangles
        return burst, BurstTruth(dynamic, hits.distance[back].astype(np.float32), surface)

    def _in_world(self, fired_ns: NDArray[np.int64], origin: Array, rays: Array) -> tuple[Array, Array]:
        """Origins and rays (N, 3) of columns fired at times (C,), given in the rig.

        Within the 47 microseconds of a column the pose is linear, which errs by less than a micrometre.
        """
        first, last = (
            self._world.path.at(fired_ns + delay)[:, None] for delay in (0, (CHANNELS - 1) * CHANNEL_NS)
        )
        share = np.linspace(0, 1, CHANNELS)[:, None, None]
        pose = (first[..., :3, :] + share * (last - first)[..., :3, :]).reshape(-1, 3, 4)
        # Not matmul: threads of its library would cost more than they save.
        start = np.einsum("nij,j->ni", pose[..., :3], origin) + pose[..., 3]
        return start, np.einsum("nij,nj->ni", pose[..., :3], rays)

    def _distance(
        self, true: NDArray[np.float32], ring: NDArray[np.int64], rng: np.random.Generator
    ) -> Array:
        """Ranges (N,) as reported: biased, noisy and quantised; inf stays."""
        bias = self._errors.range_offset_m + self._errors.channel_range_offset_m[ring]
        noisy = true - bias + rng.normal(0, NOISE_M, len(true))
        return np.asarray(np.where(np.isfinite(true), np.round(noisy / RESOLUTION_M) * RESOLUTION_M, np.inf))
