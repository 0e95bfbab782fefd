"""What things are made of: the surface ids of the truth and how each surface looks."""

from dataclasses import dataclass
from enum import IntEnum


class Surface(IntEnum):
    """Surface id of a triangle; NONE where a ray met nothing."""

    NONE = 0
    ASPHALT = 1
    GRAVEL = 2
    BUMP = 3
    POTHOLE = 4
    KERB = 5
    SIDEWALK = 6
    GRASS = 7
    FACADE = 8
    ROOF = 9
    POLE = 10
    TRUNK = 11
    FOLIAGE = 12
    CAR_BODY = 13
    CAR_GLASS = 14
    TYRE = 15
    PLATE = 16
    CLOTH = 17
    SKIN = 18
    FACE = 19
    BOARD = 20
    LAMP = 21
    PATCH = 22
    MANHOLE = 23


@dataclass(frozen=True)
class Look:
    """Albedo (linear RGB), contrast of the fine and coarse texture noise, LiDAR reflectivity 0 to 1.

    emission : light a lamp gives off at night, in units of a white surface in the sun.
    """

    albedo: tuple[float, float, float]
    fine: float
    coarse: float
    reflectivity: float
    emission: float = 0.0


LOOKS = {
    Surface.NONE: Look((0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
    Surface.ASPHALT: Look((0.13, 0.13, 0.135), 0.55, 0.30, 0.12),
    Surface.GRAVEL: Look((0.30, 0.26, 0.20), 0.75, 0.40, 0.30),
    Surface.BUMP: Look((0.16, 0.15, 0.15), 0.35, 0.20, 0.25),
    Surface.POTHOLE: Look((0.085, 0.08, 0.075), 0.80, 0.30, 0.10),
    Surface.KERB: Look((0.36, 0.36, 0.35), 0.30, 0.15, 0.35),
    Surface.SIDEWALK: Look((0.30, 0.29, 0.28), 0.35, 0.25, 0.30),
    Surface.GRASS: Look((0.10, 0.17, 0.05), 0.80, 0.50, 0.45),
    Surface.FACADE: Look((0.55, 0.50, 0.44), 0.20, 0.20, 0.45),
    Surface.ROOF: Look((0.32, 0.13, 0.09), 0.30, 0.20, 0.30),
    Surface.POLE: Look((0.35, 0.36, 0.37), 0.10, 0.10, 0.50),
    Surface.TRUNK: Look((0.16, 0.11, 0.07), 0.60, 0.30, 0.30),
    Surface.FOLIAGE: Look((0.09, 0.20, 0.05), 0.50, 0.40, 0.50),
    Surface.CAR_BODY: Look((1.0, 1.0, 1.0), 0.0, 0.03, 0.40),
    Surface.CAR_GLASS: Look((0.03, 0.035, 0.04), 0.0, 0.05, 0.05),
    Surface.TYRE: Look((0.03, 0.03, 0.03), 0.10, 0.05, 0.05),
    Surface.PLATE: Look((1.0, 1.0, 1.0), 0.0, 0.0, 0.95),
    Surface.CLOTH: Look((1.0, 1.0, 1.0), 0.15, 0.20, 0.35),
    Surface.SKIN: Look((0.55, 0.38, 0.29), 0.05, 0.05, 0.45),
    Surface.FACE: Look((1.0, 1.0, 1.0), 0.0, 0.0, 0.45),
    Surface.BOARD: Look((1.0, 1.0, 1.0), 0.0, 0.0, 0.60),
    Surface.LAMP: Look((0.8, 0.8, 0.8), 0.0, 0.0, 0.60, emission=6.0),
    Surface.PATCH: Look((0.075, 0.075, 0.08), 0.40, 0.15, 0.10),
    Surface.MANHOLE: Look((0.11, 0.11, 0.115), 0.70, 0.20, 0.35),
}
