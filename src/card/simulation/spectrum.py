"""Road roughness as a random-phase sum with the spectrum of ISO 8608."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REFERENCE_FREQUENCY = 0.1
#: Displacement spectral density at 0.1 cycles/m, m^3: the geometric mean of each class of ISO 8608.
CLASSES = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
#: Spatial frequencies, cycles/m. Hills are longer than the first, the mesh is too coarse beyond the second.
LOWEST, HIGHEST = 0.025, 2.0
WAVES = 40


@dataclass(frozen=True)
class Roughness:
    """Height (m) over road coordinates: sum of amplitude * cos(along * s + across * d + phase)."""

    amplitude: Array
    along: Array
    across: Array
    phase: Array

    def height(self, s: Array, d: Array) -> Array:
        """Heights (...) in metres at arc lengths s (...) and lateral offsets d (...), metres."""
        total = np.zeros(np.broadcast_shapes(np.shape(s), np.shape(d)))
        for a, k, c, p in zip(self.amplitude, self.along, self.across, self.phase, strict=True):
            total += a * np.cos(k * s + c * d + p)
        return total


def roughness(road_class: str, rng: np.random.Generator, period: float | None = None) -> Roughness:
    """Roughness of one ISO 8608 class; along any line of constant d it has the class's spectrum.

    G(n) = G(n0) (n / n0)^-2, band by band, ISO 8608:2016 annex B. Wave vectors point up to 45 degrees off the
    road, so that the two wheel tracks differ. ``period`` (m) makes it fit a closed road.
    """
    edges = np.geomspace(LOWEST, HIGHEST, WAVES + 1)
    n = np.sqrt(edges[1:] * edges[:-1])
    if period is not None:
        n = np.maximum(np.round(n * period), 1.0) / period
    density = CLASSES[road_class] * (n / REFERENCE_FREQUENCY) ** -2
    along = 2 * np.pi * n
    return Roughness(
        amplitude=np.sqrt(2 * density * np.diff(edges)),
        along=along,
        across=along * rng.uniform(-1, 1, WAVES),
        phase=rng.uniform(0, 2 * np.pi, WAVES),
    )
