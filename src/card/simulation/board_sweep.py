"""One sweep of the front LiDAR of a standing car over the board and what is behind it."""

from collections.abc import Sequence

import numpy as np

from card.recording.burst import Burst
from card.recording.hesai.packet import CHANNEL_OFFSET_NS, DISTANCE_UNIT_M
from card.simulation.quads import Quad, cast
from card.simulation.rig import CHANNELS, Rig, lidar_elevations_rad

TURN_NS = 100_000_000
NOISE_M = 0.005
"""One sigma of a range, as the XT32's data sheet has it."""

_MISSED = 0.01
_RANGE_LIMIT_M = 120.0


def sweep(rig: Rig, quads: Sequence[Quad], columns: int, t_ns: int, rng: np.random.Generator) -> Burst:
    """A sweep (`Burst`) from t_ns of `columns` rounds of firing of 32 channels.

    A range is off by what ``lidar_corrections`` says (measured = true - correction), noisy, and in
    steps of 4 mm; the points are laid along the nominal directions, as a sensor does that knows no better.
    """
    corrections = rig.lidar_corrections["lidar_front"]
    rotor = np.repeat(2 * np.pi * np.arange(columns) / columns, CHANNELS)
    channel = np.tile(np.arange(CHANNELS), columns)
    elevation = lidar_elevations_rad()[channel]
    shot = _directions(
        elevation + corrections.channel_elevation_offset_rad[channel],
        rotor + corrections.channel_azimuth_offset_rad[channel],
    )
    pose = rig.rig_from["lidar_front"]
    true_range, hit, cosine = cast(quads, pose[:3, 3], shot @ pose[:3, :3].T)
    offset = corrections.range_offset_m + corrections.channel_range_offset_m[channel]
    noisy = true_range - offset + rng.normal(0, NOISE_M, len(shot))
    # Grazing shots fade: below a cosine of 0.1 half of them are lost.
    lost = rng.random(len(shot)) < _MISSED + 0.5 * (cosine < 0.1)
    seen = (hit >= 0) & (true_range < _RANGE_LIMIT_M) & ~lost
    measured = np.rint(noisy[seen] / DISTANCE_UNIT_M) * DISTANCE_UNIT_M
    brightness = np.array([quad.intensity for quad in quads])[hit[seen]] + rng.integers(-6, 7, seen.sum())
    round_ns = np.repeat(TURN_NS * np.arange(columns) // columns, CHANNELS)
    return Burst(
        t_ns=t_ns,
        points=measured[:, None] * _directions(elevation, rotor)[seen],
        intensity=np.clip(brightness, 0, 255).astype(np.uint8),
        ring=channel[seen].astype(np.uint8),
        offset_ns=(round_ns + CHANNEL_OFFSET_NS[channel] - CHANNEL_OFFSET_NS[0])[seen].astype(np.uint32),
    )


def _directions(elevation: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Unit vectors (N, 3) in the LiDAR's frame; azimuth 0 is +y, clockwise seen from above."""
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)], axis=-1)
