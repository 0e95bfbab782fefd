"""What interrupts a road's surface, as heights over road coordinates: bumps, potholes, patches, manholes."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A bump runs out to its sides over this length.
BUMP_END_M = 0.3
#: Ramps of a cushion, both ways along the road.
CUSHION_RAMP_M = 0.4
#: From rim to floor of a pothole, from the road onto a patch, and around a manhole's cover.
POTHOLE_WALL_M, PATCH_EDGE_M, MANHOLE_EDGE_M = 0.04, 0.03, 0.012

PROFILES = ("round", "sinusoidal", "flat", "cushion")


@dataclass(frozen=True)
class Bump:
    """A speed bump from d_min to d_max across the road, ``length`` along it, all in metres.

    profile : ``round`` (a parabola, within 0.1 mm of the circular hump of Watts), ``sinusoidal`` (a raised
    cosine), ``flat`` (a table with straight ramps over a quarter each) or ``cushion`` (straight ramps of
    CUSHION_RAMP_M, narrower than the road).
    """

    s: float
    d_min: float
    d_max: float
    length: float
    rise: float
    profile: str = "round"

    kind = "bump"

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(s_min, s_max, d_min, d_max) outside of which the height is zero."""
        return self.s - self.length / 2, self.s + self.length / 2, self.d_min, self.d_max

    @property
    def ramp(self) -> float:
        """Length along the road of each ramp, m."""
        return {"flat": self.length / 4, "cushion": CUSHION_RAMP_M}.get(self.profile, self.length / 2)

    def height(self, s: Array, d: Array) -> Array:
        """Height (...) in metres above the road without it."""
        up = np.clip((self.length / 2 - np.abs(s - self.s)) / self.ramp, 0.0, 1.0)
        if self.profile == "round":
            up = up * (2 - up)
        elif self.profile == "sinusoidal":
            up = 0.5 * (1 - np.cos(np.pi * up))
        ends = np.clip(np.minimum(d - self.d_min, self.d_max - d) / BUMP_END_M, 0.0, 1.0)
        return self.rise * up * _smooth(ends)


@dataclass(frozen=True)
class Pothole:
    """A pothole at (s, d) with radii along and across, ``depth``, and a ragged rim, all in metres."""

    s: float
    d: float
    along: float
    across: float
    depth: float
    rim: Array = field(default_factory=lambda: np.zeros((3, 2)))

    kind = "pothole"

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(s_min, s_max, d_min, d_max) outside of which the height is zero."""
        return _around(self.s, self.d, self.along, self.across)

    @property
    def wall(self) -> float:
        """Width of the wall as a share of the smaller radius."""
        return POTHOLE_WALL_M / min(self.along, self.across)

    def edge(self, angle: Array) -> Array:
        """Share (...) of the radii at which the wall begins, by angle (from along to across)."""
        ragged = sum(a * np.cos((i + 2) * angle + p) for i, (a, p) in enumerate(self.rim))
        return np.asarray(0.85 + ragged)

    def height(self, s: Array, d: Array) -> Array:
        """Height (...) in metres above the road without it: zero or negative."""
        u, v = (s - self.s) / self.along, (d - self.d) / self.across
        inward = (self.edge(np.arctan2(v, u)) - np.hypot(u, v)) / self.wall
        return -self.depth * _smooth(np.clip(inward, 0.0, 1.0))


@dataclass(frozen=True)
class Manhole:
    """A round cover that lies ``rise`` m higher (or, negative, lower) than the road around it."""

    s: float
    d: float
    rise: float
    along: float = 0.34
    across: float = 0.34

    kind = "manhole"

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(s_min, s_max, d_min, d_max) outside of which the height is zero."""
        return _around(self.s, self.d, self.along, self.across)

    @property
    def wall(self) -> float:
        """Width of the edge as a share of the radius."""
        return MANHOLE_EDGE_M / self.along

    def edge(self, angle: Array) -> Array:
        """Share (...) of the radius at which the edge begins."""
        return np.full_like(angle, 0.97)

    def height(self, s: Array, d: Array) -> Array:
        """Height (...) in metres above the road without it."""
        away = np.hypot((s - self.s) / self.along, (d - self.d) / self.across)
        return self.rise * _smooth(np.clip((self.edge(away) - away) / self.wall, 0.0, 1.0))


@dataclass(frozen=True)
class Patch:
    """A rectangle of newer asphalt, ``rise`` m higher (or lower) than the road around it; half sizes in m."""

    s: float
    d: float
    along: float
    across: float
    rise: float

    kind = "patch"

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(s_min, s_max, d_min, d_max) outside of which the height is zero."""
        return _around(self.s, self.d, self.along, self.across)

    def height(self, s: Array, d: Array) -> Array:
        """Height (...) in metres above the road without it."""
        along = np.clip((self.along - np.abs(s - self.s)) / PATCH_EDGE_M, 0.0, 1.0)
        return self.rise * along * np.clip((self.across - np.abs(d - self.d)) / PATCH_EDGE_M, 0.0, 1.0)


Irregularity = Bump | Pothole | Manhole | Patch


def pothole(s: float, d: float, rng: np.random.Generator) -> Pothole:
    """A pothole of random size and shape."""
    rim = np.stack([rng.uniform(0, 0.05, 3), rng.uniform(0, 2 * np.pi, 3)], axis=1)
    return Pothole(s, d, rng.uniform(0.35, 0.7), rng.uniform(0.25, 0.45), rng.uniform(0.04, 0.08), rim)


def _around(s: float, d: float, along: float, across: float) -> tuple[float, float, float, float]:
    return s - along, s + along, d - across, d + across


def _smooth(x: Array) -> Array:
    return x * x * (3 - 2 * x)
