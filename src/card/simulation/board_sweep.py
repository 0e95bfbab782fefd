"""One sweep of the front LiDAR of a standing car over the board and what is behind it."""

from collections.abc import Sequence

import numpy as np

from card.recording.burst import Burst
from card.simulation.echoes import echo_power, measured_range, returns_of
from card.simulation.lidar import CHANNEL_NS, columns, directions
from card.simulation.quads import Quad, cast
from card.simulation.rig import CHANNELS, Rig, lidar_elevations_rad


def sweep(
    rig: Rig, quads: Sequence[Quad], count: int, number: int, t_ns: int, rng: np.random.Generator
) -> Burst:
    """Revolution `number` (`Burst`), from t_ns on, of `count` rounds of firing of 32 channels.

    A range is off by what ``lidar_corrections`` says (measured = true - correction), with the noise and the
    dropouts of `echoes`; points are laid along the nominal directions, as a sensor does that knows no better.
    """
    corrections = rig.lidar_corrections["lidar_front"]
    fired, rotor = columns(count, number)
    ring = np.tile(np.arange(CHANNELS), count)
    azimuth, elevation = rotor.repeat(CHANNELS), lidar_elevations_rad()[ring]
    shot = directions(
        azimuth + corrections.channel_azimuth_offset_rad[ring],
        elevation + corrections.channel_elevation_offset_rad[ring],
    )
    pose = rig.rig_from["lidar_front"]
    distance, hit, cosine = cast(quads, pose[:3, 3], shot @ pose[:3, :3].T)
    reflectivity = np.array([quad.intensity for quad in quads] + [0])[hit] / 255
    back = returns_of(distance[None], echo_power(distance, reflectivity, cosine)[None], rng, dual=False).beam
    measured = measured_range(distance[back], ring[back], corrections, rng)
    brightness = 255 * reflectivity[back] + rng.integers(-6, 7, len(back))
    return Burst(
        t_ns=t_ns,
        points=measured[:, None] * directions(azimuth, elevation)[back],
        intensity=np.clip(brightness, 0, 255).astype(np.uint8),
        ring=ring[back].astype(np.uint8),
        offset_ns=(fired.repeat(CHANNELS) + ring * CHANNEL_NS)[back].astype(np.uint32),
    )
