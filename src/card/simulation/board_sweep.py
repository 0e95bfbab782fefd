"""One sweep of the front LiDAR of a standing car over the board and what is behind it."""

from collections.abc import Sequence

import numpy as np

from card.recording.burst import Burst
from card.simulation.lidar import CHANNEL_NS, NOISE_M, REACH_M, RESOLUTION_M, columns, directions
from card.simulation.quads import Quad, cast
from card.simulation.rig import CHANNELS, Rig, lidar_elevations_rad

_MISSED = 0.01


def sweep(
    rig: Rig, quads: Sequence[Quad], count: int, number: int, t_ns: int, rng: np.random.Generator
) -> Burst:
    """Revolution `number` (`Burst`), from t_ns on, of `count` rounds of firing of 32 channels.

    A range is off by what ``lidar_corrections`` says (measured = true - correction), noisy, and in steps
    of 4 mm; the points are laid along the nominal directions, as a sensor does that knows no better.
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
    offset = corrections.range_offset_m + corrections.channel_range_offset_m[ring]
    noisy = distance - offset + rng.normal(0, NOISE_M, len(shot))
    # Grazing shots fade: below a cosine of 0.1 half of them are lost.
    lost = rng.random(len(shot)) < _MISSED + 0.5 * (cosine < 0.1)
    seen = (hit >= 0) & (distance < REACH_M) & ~lost
    measured = np.rint(noisy[seen] / RESOLUTION_M) * RESOLUTION_M
    brightness = np.array([quad.intensity for quad in quads])[hit[seen]] + rng.integers(-6, 7, seen.sum())
    return Burst(
        t_ns=t_ns,
        points=measured[:, None] * directions(azimuth, elevation)[seen],
        intensity=np.clip(brightness, 0, 255).astype(np.uint8),
        ring=ring[seen].astype(np.uint8),
        offset_ns=(fired.repeat(CHANNELS) + ring * CHANNEL_NS)[seen].astype(np.uint32),
    )
