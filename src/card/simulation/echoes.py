"""What a LiDAR makes of a beam's echoes: which it notices, what range and intensity it reports.

Figures of the XT32's data sheet (Hesai): 1 cm of accuracy, 5 mm of precision, ranges in steps of 4 mm, 80 m
of range at a reflectivity of 10 %, two returns: the strongest and the last.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.simulation.rig import LidarCorrections

Array = NDArray[np.float64]
Index = NDArray[np.intp]

RESOLUTION_M, NOISE_M = 0.004, 0.005
NEAREST_M, REACH_M = 0.05, 120.0
#: Where half of the echoes of 10 % reflectivity come back; at 80 m seven of eight do.
_HALF_BACK_M, _STEEPNESS = 110.0, 3.0
#: Share of beams that are lost anyhow.
_MISSED = 0.002
#: Echoes that are closer than this are one: half the length of a pulse of some nanoseconds.
_APART_M = 0.4
#: How a beam's light is spread over rays about its axis: angles right and up (rad), share of the light.
PENCIL = np.array([[0.0, 0.0, 1.0]])
BEAM = np.array(
    [[0, 0, 0.4], [-1e-3, 0, 0.15], [1e-3, 0, 0.15], [0, -1e-3, 0.15], [0, 1e-3, 0.15]], np.float64
)


def echo_power(distance: Array, reflectivity: Array, cosine: Array) -> Array:
    """Light that comes back of a diffuse surface, 1/m^2: reflectivity times cosine over squared distance."""
    with np.errstate(divide="ignore", invalid="ignore"):
        power = reflectivity * cosine / np.square(distance)
    return np.asarray(np.where(np.isfinite(distance), power, 0.0))


def detection_rate(power: Array) -> Array:
    """Share of echoes of a power that are noticed: half at 10 % reflectivity, head on, from 110 m."""
    relative = power / (0.1 / _HALF_BACK_M**2)
    return np.asarray((1 - _MISSED) * relative**_STEEPNESS / (1 + relative**_STEEPNESS))


def measured_range(
    true: Array, ring: NDArray[np.int64], errors: LidarCorrections, rng: np.random.Generator
) -> Array:
    """Ranges (N,) as reported: biased, noisy and in whole steps; what has to be added makes them true."""
    bias = errors.range_offset_m + errors.channel_range_offset_m[ring]
    noisy = true - bias + rng.normal(0, NOISE_M, len(true))
    return np.asarray(np.rint(noisy / RESOLUTION_M) * RESOLUTION_M)


def intensity(reflectivity: Array, cosine: Array) -> NDArray[np.uint8]:
    """Reported reflectivity, 1 to 255, which makes up for the range but not all of the incidence."""
    return np.clip(np.rint(255 * reflectivity * (0.3 + 0.7 * cosine)), 1, 255).astype(np.uint8)


@dataclass(frozen=True)
class Returns:
    """Echoes that a LiDAR reports, K of them: index of the beam (K,) and of the ray (K,) that made it."""

    beam: Index
    ray: Index


def returns_of(distance: Array, power: Array, rng: np.random.Generator, *, dual: bool) -> Returns:
    """What comes back of N beams of R rays each, distances and powers (R, N), inf and 0 for none.

    The strongest return of each beam, and with ``dual`` the last one too where it is another.
    """
    with np.errstate(invalid="ignore"):
        near = np.abs(distance[:, None] - distance[None]) < _APART_M  # inf is near to nothing
    total = np.einsum("ijn,jn->in", near, power)
    chance = rng.random(distance.shape[1])
    noticed = (chance < detection_rate(total)) & (distance > NEAREST_M) & (distance < REACH_M)
    beams = np.arange(distance.shape[1])
    strongest = np.argmax(np.where(noticed, total, -1.0), axis=0)
    some = noticed[strongest, beams]
    found = [Returns(beams[some], strongest[some])]
    if dual:
        last = np.argmax(np.where(noticed, distance, -1.0), axis=0)
        with np.errstate(invalid="ignore"):
            other = some & (distance[last, beams] - distance[strongest, beams] >= _APART_M)
        found.append(Returns(beams[other], last[other]))
    beam, ray = (np.concatenate([getattr(f, name) for f in found]) for name in ("beam", "ray"))
    order = np.argsort(beam, kind="stable")
    return Returns(beam[order], ray[order])
