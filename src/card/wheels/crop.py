"""The few points of a raw burst that can lie in a wheel corridor, found before anything is transformed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, apply, inverse
from card.recording.burst import Burst
from card.wheels.contact_path import ContactPath

Array = NDArray[np.float64]
Window = tuple[float, float]
#: Cells are wider than a corridor's half width, half a path step and half the way between two looks together.
CELL_M = 0.6
PATH_STEP_M = 0.2
LOOKS = 5


def crop_burst(
    burst: Burst,
    rig_from_lidar: Array,
    trajectory: Trajectory,
    paths: Sequence[ContactPath],
    windows: Sequence[Window],
) -> Burst:
    """The points of a burst whose x, y in the sensor frame are near a path, seen from anywhere in the sweep.

    Coarse on purpose: the paths inside their arc windows are marked on a grid as the sensor sees them at
    some times of the sweep, widened by a cell. Keeps every corridor point up to 40 m/s.
    """
    track = np.concatenate([_track(path, window) for path, window in zip(paths, windows, strict=True)])
    times = np.linspace(0, burst.end_ns - burst.t_ns, LOOKS).astype(np.int64) + burst.t_ns
    lidar_from_world = inverse(trajectory.at(times) @ rig_from_lidar)
    seen = np.concatenate([apply(look, track)[:, :2] for look in lidar_from_world])
    cells = np.floor(seen / CELL_M).astype(np.int64)
    low = cells.min(axis=0) - 1
    grid = np.zeros(cells.max(axis=0) - low + 2, dtype=bool)
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            grid[cells[:, 0] - low[0] + dx, cells[:, 1] - low[1] + dy] = True
    at = np.floor(burst.points[:, :2] / CELL_M).astype(np.int64) - low
    near = np.all((at >= 0) & (at < grid.shape), axis=1)
    near[near] = grid[at[near, 0], at[near, 1]]
    return replace(
        burst,
        points=burst.points[near],
        intensity=burst.intensity[near],
        ring=burst.ring[near],
        offset_ns=burst.offset_ns[near],
    )


def _track(path: ContactPath, window: Window) -> Array:
    """Points (T, 3) of a path every `PATH_STEP_M` inside an arc window."""
    arc = np.arange(max(window[0], 0.0), min(window[1], path.knot_arc[-1]) + PATH_STEP_M, PATH_STEP_M)
    arc = np.minimum(arc, path.knot_arc[-1])
    return path.surface(arc, np.zeros_like(arc))
