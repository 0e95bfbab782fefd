"""A fleet of drives of the paper's size, for the assignment of splits: tracks and strata, no files.

118 drives of 1 to 10 minutes in 12 + 9 places, some through the same streets (paper, 'Dataset scale and
splits').
"""

import numpy as np
from numpy.typing import NDArray

from card.splits.drives import Drive
from card.splits.tracks import Track

DRIVES, PLACES, ZERO_SHOT = 118, 21, 5
RATE_HZ, SPEED_M_S, TOWN_M, BLOCK_M = 10.0, 8.0, 4000.0, 200.0


def fleet(seed: int) -> list[Drive]:
    """The drives; the same seed gives the same."""
    rng = np.random.default_rng(seed)
    drives = []
    for index in range(DRIVES):
        place = f"p{rng.integers(PLACES):02d}"
        seconds = rng.uniform(60, 600)
        frames = np.arange(round(RATE_HZ * seconds))
        off_road = rng.random() < 0.1
        strata = _strata(frames.size, off_road, rng)
        drives.append(
            Drive(
                id=f"d{index:03d}",
                place=place,
                role="zero_shot" if index < ZERO_SHOT else "split",
                frames=frames,
                t_ns=(frames * 1e9 / RATE_HZ).astype(np.int64),
                sampled=frames % 3 == 0,
                strata=tuple(f"{name}/{place}" for name in strata),
                track=Track(f"map {place}", frames, _streets(frames.size, rng)),
            )
        )
    return drives


def _streets(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Places (N, 2) along a grid of streets from a corner of it, turning by chance at the next ones."""
    at = rng.integers(0, int(TOWN_M / BLOCK_M), 2) * BLOCK_M
    corners, heading = [at], rng.integers(4)
    turns = ((1, 0), (0, 1), (-1, 0), (0, -1))
    while len(corners) * BLOCK_M < count * SPEED_M_S / RATE_HZ + BLOCK_M:
        heading = (heading + rng.choice([-1, 0, 0, 0, 1])) % 4
        corners.append(corners[-1] + BLOCK_M * np.array(turns[heading]))
    along = np.arange(count) * SPEED_M_S / RATE_HZ
    ways = np.arange(len(corners)) * BLOCK_M
    return np.stack([np.interp(along, ways, [corner[axis] for corner in corners]) for axis in (0, 1)], axis=1)


def _strata(count: int, off_road: bool, rng: np.random.Generator) -> list[str]:
    """Topography of each frame: an irregularity is in view for some seconds."""
    if off_road:
        return ["off_road"] * count
    names = ["none"] * count
    for name, rate in (("positive", 0.03), ("negative", 0.02)):
        for start in np.flatnonzero(rng.random(count) < rate / RATE_HZ):
            names[start : start + 40] = [name] * len(names[start : start + 40])
    return names
