"""A spinning XT32: 32 channels a column, each ray at its own time against the moving world."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.recording.burst import Burst
from card.simulation.echoes import BEAM, PENCIL, echo_power, intensity, measured_range, returns_of
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CHANNELS, LidarCorrections, lidar_elevations_rad
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.world import World

Array = NDArray[np.float64]

PERIOD_NS = 100_000_000
#: Time between two channels of a column (XT32 manual).
CHANNEL_NS = 1512
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
    """One LiDAR of a world's car.

    dual : it reports the last return of a beam beside the strongest one.
    """

    def __init__(self, world: World, tracer: Tracer, ego: Scene, name: str, *, dual: bool = False) -> None:
        self.name, self._world, self._tracer, self._ego = name, world, tracer, ego
        self._dual, self._rays = dual, BEAM if dual else PENCIL
        self._errors: LidarCorrections = world.rig.lidar_corrections[name]

    def scan(self, t_ns: int, number: int) -> tuple[Burst, BurstTruth]:
        """Revolution ``number``, which starts at ``t_ns``; its noise is its own."""
        noise = self._world.rng(f"noise of {self.name} {number}")
        fired, azimuth = columns(self._world.scale.columns, number)
        ring = np.tile(np.arange(CHANNELS), len(fired))
        offset = fired.repeat(CHANNELS) + ring * CHANNEL_NS
        measured = (azimuth.repeat(CHANNELS), lidar_elevations_rad()[ring])
        true = (
            measured[0] + self._errors.channel_azimuth_offset_rad[ring],
            measured[1] + self._errors.channel_elevation_offset_rad[ring],
        )
        distance, cosine, triangle = self._met(t_ns, fired, offset, true)
        reflectivity = _REFLECTIVITY[self._tracer.all.surface[triangle]]
        power = self._rays[:, 2:] * echo_power(distance, reflectivity, cosine)
        back = returns_of(distance, power, noise, dual=self._dual)

        beam, echo = back.beam, (back.ray, back.beam)
        ranges = measured_range(distance[echo], ring[beam], self._errors, noise)
        burst = Burst(
            t_ns,
            ranges[:, None] * directions(measured[0][beam], measured[1][beam]),
            intensity(reflectivity[echo], cosine[echo]),
            ring[beam].astype(np.uint8),
            offset[beam].astype(np.uint32),
        )
        hit = triangle[echo]
        return burst, BurstTruth(
            hit >= self._tracer.static_triangles,
            distance[echo].astype(np.float32),
            self._tracer.all.surface[hit],
        )

    def _met(
        self, t_ns: int, fired: NDArray[np.int64], offset: NDArray[np.int64], angles: tuple[Array, Array]
    ) -> tuple[Array, Array, NDArray[np.int32]]:
        """What each ray of each beam meets (R, N): distance, cosine of incidence and triangle.

        A distance is inf where there is nothing or our own car is in the way.
        """
        rig_from_lidar = self._world.rig.rig_from[self.name]
        shape = len(self._rays), len(offset)
        distance, cosine = np.empty(shape), np.empty(shape)
        triangle = np.empty(shape, np.int32)
        for k, (right, up, _) in enumerate(self._rays):
            beams = directions(angles[0] + right, angles[1] + up)
            in_rig = np.einsum("ij,nj->ni", rig_from_lidar[:3, :3], beams)
            origins, rays = self._in_world(t_ns + fired, rig_from_lidar[:3, 3], in_rig)
            hits = self._tracer.cast(origins, rays, t_ns + offset)
            own = self._ego.cast(rig_from_lidar[:3, 3], in_rig).distance
            distance[k] = np.where(own > hits.distance, hits.distance, np.inf)
            cosine[k] = np.abs(np.einsum("ni,ni->n", hits.normal, rays))
            triangle[k] = hits.triangle
        return distance, cosine, triangle

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
