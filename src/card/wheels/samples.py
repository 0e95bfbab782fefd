"""Road points under each wheel, streamed out of the bursts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import progress
from card.artifacts.processes import in_processes
from card.estimation.deskew import deskew_burst
from card.geometry import Trajectory
from card.recording.laz import read_burst
from card.wheels.arc_height import Corridor, RoadPoints, corridor_points
from card.wheels.contact_path import ContactPath
from card.wheels.crop import Track, crop_burst
from card.wheels.static_points import StaticVoxels

Array = NDArray[np.float64]
#: Bursts that a process takes at a time.
BURSTS_AT_ONCE = 40


@dataclass(frozen=True)
class Lidar:
    """How the points of one LiDAR get to the world: extrinsic (4, 4), corrections, state of deskew."""

    rig_from_lidar: Array
    corrections: Mapping[str, Any]
    deskewed: bool


@dataclass(frozen=True)
class BurstFile:
    """A burst to read: its LiDAR, start in ns, number of points and file."""

    lidar: str
    t_start_ns: int
    points: int
    file: str


def spaced_bursts(
    bursts: Sequence[BurstFile], path: ContactPath, points_per_m: float, min_step_m: float
) -> list[BurstFile]:
    """So many bursts of each LiDAR that the way to the next one is about their points by `points_per_m`.

    It is at least a step: a standing car sees the same points over and over.
    """
    following: dict[str, float] = {}
    kept = []
    arcs = path.arc_at([burst.t_start_ns for burst in bursts]).tolist()
    for burst, arc in zip(bursts, arcs, strict=True):
        if arc >= following.get(burst.lidar, arc):
            following[burst.lidar] = arc + max(burst.points / points_per_m, min_step_m)
            kept.append(burst)
    return kept


@dataclass(frozen=True)
class Cutter:
    """Cuts the wheels' corridors out of bursts.

    A burst only serves the pass it was taken on: path within `arc_window_m` of where the wheel then was.
    """

    lidars: Mapping[str, Lidar]
    trajectory: Trajectory
    paths: Sequence[ContactPath]
    static: StaticVoxels
    static_reach: int
    corridor: Corridor
    arc_window_m: float

    def cut(self, bursts: Sequence[BurstFile]) -> list[RoadPoints]:
        """Each wheel's corridor points of the bursts."""
        found: list[list[tuple[RoadPoints, Array]]] = [[] for _ in self.paths]
        arcs = np.stack([path.arc_at([entry.t_start_ns for entry in bursts]) for path in self.paths], axis=1)
        for entry, arc in zip(bursts, arcs.tolist(), strict=True):
            windows = [(at - self.arc_window_m, at + self.arc_window_m) for at in arc]
            points = self._near_points(entry, windows)
            for pieces, path, window in zip(found, self.paths, windows, strict=True):
                road, which = corridor_points(points, path, window, self.corridor)
                pieces.append((road, points[which]))
        return [self._static(pieces) for pieces in found]

    def _static(self, pieces: Sequence[tuple[RoadPoints, Array]]) -> RoadPoints:
        """Those of one wheel's points, given in world too, that lie in or near the static voxels."""
        road, world = zip(*pieces, strict=True)
        return RoadPoints.joined(road).part(self.static.near(np.concatenate(world), self.static_reach))

    def _near_points(self, entry: BurstFile, windows: Sequence[tuple[float, float]]) -> Array:
        """World points (P, 3) of a burst near the paths."""
        lidar = self.lidars[entry.lidar]
        whole = read_burst(Path(entry.file), intensity=False)
        burst = crop_burst(whole, lidar.rig_from_lidar, self.trajectory, self._tracks, windows)
        return deskew_burst(
            burst,
            lidar.rig_from_lidar,
            self.trajectory,
            lidar.corrections,
            motion_compensate=not lidar.deskewed,
            end_ns=whole.end_ns,
        )

    @cached_property
    def _tracks(self) -> list[Track]:
        return [Track.of(path) for path in self.paths]


def collect_samples(bursts: Sequence[BurstFile], cutter: Cutter, threads: int) -> list[RoadPoints]:
    """Each wheel's corridor points of all bursts, in their order; `threads` processes share the bursts."""
    blocks = [bursts[i : i + BURSTS_AT_ONCE] for i in range(0, len(bursts), BURSTS_AT_ONCE)]
    found = list(progress(in_processes(cutter.cut, blocks, threads), "wheels", len(blocks)))
    return [RoadPoints.joined([block[wheel] for block in found]) for wheel in range(len(cutter.paths))]
