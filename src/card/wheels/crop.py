"""The few points of a raw burst that can lie in a wheel corridor, found before anything is transformed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, apply, inverse
from card.recording.burst import Burst
from card.wheels.contact_path import ContactPath
from card.wheels.corridor_kernels import near_cells

Array = NDArray[np.float64]
Window = tuple[float, float]
#: Cells are wider than a corridor's half width, half a path step and half the way between two looks together.
CELL_M = 0.6
PATH_STEP_M = 0.2
LOOKS = 5


@dataclass(frozen=True)
class Track:
    """Points (T, 3) in world every `PATH_STEP_M` along a contact path."""

    points: Array

    @classmethod
    def of(cls, path: ContactPath) -> "Track":
        """The track of a path, to the end of it."""
        arc = np.arange(0.0, path.knot_arc[-1] + PATH_STEP_M, PATH_STEP_M)
        arc = np.minimum(arc, path.knot_arc[-1])
        return cls(path.surface(arc, np.zeros_like(arc)))

    def within(self, window: Window) -> Array:
        """Those inside an arc window and one more on either side; at least one."""
        first = min(max(int(np.floor(window[0] / PATH_STEP_M)), 0), len(self.points) - 1)
        return self.points[first : int(np.ceil(window[1] / PATH_STEP_M)) + 1]


def crop_burst(
    burst: Burst,
    rig_from_lidar: Array,
    trajectory: Trajectory,
    tracks: Sequence[Track],
    windows: Sequence[Window],
) -> Burst:
    """The points of a burst whose x, y in the sensor frame are near a path, seen from anywhere in the sweep.

    Coarse on purpose: the paths inside their arc windows are marked on a grid as the sensor sees them at
    some times of the sweep, widened by a cell. Keeps every corridor point up to 40 m/s.
    """
    track = np.concatenate([track.within(window) for track, window in zip(tracks, windows, strict=True)])
    times = np.linspace(0, burst.end_ns - burst.t_ns, LOOKS).astype(np.int64) + burst.t_ns
    lidar_from_world = inverse(trajectory.at(times) @ rig_from_lidar)
    seen = np.concatenate([apply(look, track)[:, :2] for look in lidar_from_world])
    near = near_cells(burst.points, seen, CELL_M)
    return replace(
        burst,
        points=burst.points[near],
        intensity=burst.intensity[near],
        ring=burst.ring[near],
        offset_ns=burst.offset_ns[near],
    )
