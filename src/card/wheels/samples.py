"""Road points under each wheel, streamed out of the bursts."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.estimation.deskew import deskew_burst
from card.geometry import Trajectory
from card.recording.laz import read_burst
from card.wheels.arc_height import Corridor, RoadPoints, corridor_points
from card.wheels.contact_path import ContactPath
from card.wheels.crop import crop_burst
from card.wheels.static_points import StaticVoxels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lidar:
    """How the points of one LiDAR get to the world: extrinsic (4, 4), corrections, state of deskew."""

    rig_from_lidar: Array
    corrections: Mapping[str, Any]
    deskewed: bool


@dataclass(frozen=True)
class BurstFile:
    """A burst to read: its LiDAR, start in ns and file."""

    lidar: str
    t_start_ns: int
    file: Path


def moving_bursts(bursts: Iterable[BurstFile], path: ContactPath, min_step_m: float) -> list[BurstFile]:
    """The bursts before which the wheel moved a step since the last one kept of the same LiDAR.

    A standing car sees the same points over and over.
    """
    last: dict[str, float] = {}
    kept = []
    for burst in bursts:
        arc = float(path.arc_at(burst.t_start_ns))
        if burst.lidar not in last or arc - last[burst.lidar] >= min_step_m:
            last[burst.lidar] = arc
            kept.append(burst)
    return kept


def collect_samples(
    bursts: Iterable[BurstFile],
    lidars: Mapping[str, Lidar],
    trajectory: Trajectory,
    paths: Sequence[ContactPath],
    static: StaticVoxels,
    static_reach: int,
    corridor: Corridor,
    arc_window_m: float,
) -> list[RoadPoints]:
    """Each wheel's corridor points.

    A burst only serves the pass it was taken on: path within `arc_window_m` of where the wheel then was.
    """
    pieces: list[list[RoadPoints]] = [[] for _ in paths]
    for points, windows in _static_points(
        bursts, lidars, trajectory, paths, static, static_reach, arc_window_m
    ):
        for piece, path, window in zip(pieces, paths, windows, strict=True):
            piece.append(corridor_points(points, path, window, corridor))
    return [RoadPoints.joined(piece) for piece in pieces]


def _static_points(
    bursts: Iterable[BurstFile],
    lidars: Mapping[str, Lidar],
    trajectory: Trajectory,
    paths: Sequence[ContactPath],
    static: StaticVoxels,
    static_reach: int,
    arc_window_m: float,
) -> Iterator[tuple[Array, list[tuple[float, float]]]]:
    """World points (P, 3) of each burst near the paths and the static voxels, and the arc windows."""
    for entry in bursts:
        lidar = lidars[entry.lidar]
        arcs = [float(path.arc_at(entry.t_start_ns)) for path in paths]
        windows = [(arc - arc_window_m, arc + arc_window_m) for arc in arcs]
        whole = read_burst(entry.file)
        burst = crop_burst(whole, lidar.rig_from_lidar, trajectory, paths, windows)
        if len(burst) == 0:
            continue
        points = deskew_burst(
            burst,
            lidar.rig_from_lidar,
            trajectory,
            lidar.corrections,
            motion_compensate=not lidar.deskewed,
            end_ns=whole.end_ns,
        )
        points = points[static.near(points, static_reach)]
        if len(points):
            yield points, windows
