"""One LiDAR sweep in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

#: An XT32 turns at 5, 10 or 20 Hz; a burst that lasts longer than this is not one sweep.
MAX_BURST_NS = 250_000_000


@dataclass(frozen=True)
class Burst:
    """One LiDAR sweep, raw: sensor frame, not deskewed, not corrected.

    t_ns: start of the burst, int nanoseconds on the recording's clock.
    points: (N, 3) float64, metres, sensor frame (x right, y forward, z up).
    intensity: (N,) uint8, reflectivity as the sensor gives it.
    ring: (N,) uint8, channel, 0 is the topmost.
    offset_ns: (N,) uint32, time of each point since `t_ns`, nanoseconds.
    """

    t_ns: int
    points: npt.NDArray[np.float64]
    intensity: npt.NDArray[np.uint8]
    ring: npt.NDArray[np.uint8]
    offset_ns: npt.NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.points)

    @property
    def time_ns(self) -> npt.NDArray[np.int64]:
        """(N,) int64, the time of each point in nanoseconds."""
        return self.t_ns + self.offset_ns.astype(np.int64)

    @property
    def end_ns(self) -> int:
        """Time of the last point in nanoseconds; the start for a burst without points."""
        return self.t_ns + (int(self.offset_ns.max()) if len(self.offset_ns) else 0)
