"""What interrupts a road's surface: speed bumps and potholes, as heights over road coordinates."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A bump runs out to its sides over this length.
BUMP_END_M = 0.3


@dataclass(frozen=True)
class Bump:
    """A speed bump across the road from d_min to d_max, ``length`` along it, all in metres.

    profile : ``round`` (a raised cosine) or ``flat`` (a table with cosine ramps over a quarter each).
    """

    s: float
    d_min: float
    d_max: float
    length: float
    rise: float
    profile: str = "round"

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(s_min, s_max, d_min, d_max) outside of which the height is zero."""
        return self.s - self.length / 2, self.s + self.length / 2, self.d_min, self.d_max

    def height(self, s: Array, d: Array) -> Array:
        """Height (...) in metres above the road without it."""
        x = np.clip(np.abs(s - self.s) / (self.length / 2), 0.0, 1.0)
        if self.profile == "flat":
            x = np.clip(2 * x - 1, 0.0, 1.0)
        ends = np.clip(np.minimum(d - self.d_min, self.d_max - d) / BUMP_END_M, 0.0, 1.0)
        return self.rise * 0.5 * (1 + np.cos(np.pi * x)) * _smooth(ends)


@dataclass(frozen=True)
class Pothole:
    """A pothole at (s, d) with radii along and across, ``depth``, and a ragged rim, all in metres."""

    s: float
    d: float
    along: float
    across: float
    depth: float
    rim: Array = field(default_factory=lambda: np.zeros((3, 2)))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(s_min, s_max, d_min, d_max) outside of which the height is zero."""
        return self.s - self.along, self.s + self.along, self.d - self.across, self.d + self.across

    def height(self, s: Array, d: Array) -> Array:
        """Height (...) in metres above the road without it: zero or negative."""
        u, v = (s - self.s) / self.along, (d - self.d) / self.across
        angle = np.arctan2(v, u)
        rim = 0.85 + sum(a * np.cos((i + 2) * angle + p) for i, (a, p) in enumerate(self.rim))
        wall = 0.10 / min(self.along, self.across)
        return -self.depth * _smooth(np.clip((rim - np.hypot(u, v)) / wall, 0.0, 1.0))


Irregularity = Bump | Pothole


def pothole(s: float, d: float, rng: np.random.Generator) -> Pothole:
    """A pothole of random size and shape."""
    rim = np.stack([rng.uniform(0, 0.05, 3), rng.uniform(0, 2 * np.pi, 3)], axis=1)
    return Pothole(s, d, rng.uniform(0.35, 0.7), rng.uniform(0.25, 0.45), rng.uniform(0.04, 0.08), rim)


def _smooth(x: Array) -> Array:
    return x * x * (3 - 2 * x)
