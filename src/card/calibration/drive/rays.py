"""The returns of both LiDARs over a session's drive, thinned and held in memory."""

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.estimation.scans import Limits, Scan
from card.geometry import apply
from card.geometry.corrections import correct_points
from card.recording.laz import read_burst
from card.recording.paths import LIDARS, list_bursts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rays:
    """Returns in order of sweeps, each raw in its own sensor's frame.

    points (N, 3) m, ring (N,), time_ns (N,), lidar (N,) index into LIDARS; the sweeps' lidar, start_ns,
    end_ns (S,), and the first return of each, first (S+1,).
    """

    points: Array
    ring: NDArray[np.uint8]
    time_ns: NDArray[np.int64]
    lidar: NDArray[np.int8]
    sweep_lidar: NDArray[np.int8]
    start_ns: NDArray[np.int64]
    end_ns: NDArray[np.int64]
    first: NDArray[np.int64]

    def corrected(self, corrections: Mapping[str, Any]) -> Array:
        """Points (N, 3) with the corrections of each LiDAR, ``lidar_corrections`` of a calibration."""
        result = np.empty_like(self.points)
        for index, name in enumerate(LIDARS):
            mine = self.lidar == index
            result[mine] = correct_points(self.points[mine], self.ring[mine], corrections[name])
        return result

    def thinned(self, returns: int) -> "Rays":
        """At most about so many returns of a sweep, evenly taken."""
        step = max(1, round(len(self.ring) / (len(self.sweep_lidar) * returns)))
        return replace(
            self,
            points=self.points[::step],
            ring=self.ring[::step],
            time_ns=self.time_ns[::step],
            lidar=self.lidar[::step],
            first=-(-self.first // step),
        )

    def sweeps_of(self, lidar: int) -> NDArray[np.intp]:
        """Ordinals of one LiDAR's sweeps."""
        return np.flatnonzero(self.sweep_lidar == lidar)


class HeldSweeps:
    """The sweeps of one LiDAR as `card.estimation.odometry` takes them."""

    def __init__(self, rays: Rays, lidar: int, points: Array, rig_from_lidar: Array) -> None:
        """points (N, 3) : all returns of `rays`, corrected."""
        self._rays, self._points, self._rig_from_lidar = rays, points, rig_from_lidar
        self._sweeps = rays.sweeps_of(lidar)
        self.lidar = np.full(len(self._sweeps), LIDARS[lidar], dtype=object)
        self.start_ns, self.end_ns = rays.start_ns[self._sweeps], rays.end_ns[self._sweeps]

    def __len__(self) -> int:
        return len(self._sweeps)

    def __getitem__(self, i: int) -> Scan:
        sweep = self._sweeps[i]
        mine = slice(self._rays.first[sweep], self._rays.first[sweep + 1])
        in_rig = apply(self._rig_from_lidar, self._points[mine])
        return Scan(int(self.start_ns[i]), int(self.end_ns[i]), in_rig, self._rays.time_ns[mine], False)

    def ahead(self, chosen: Iterable[int]) -> Iterator[tuple[int, Scan]]:
        """Sweeps in the given order."""
        for i in chosen:
            yield i, self[i]


def read_rays(drive: Path, limits: Limits, returns: int, threads: int) -> Rays:
    """Returns of both LiDARs within limits, at most about so many of a sweep, taken evenly over its rings.

    Raises
    ------
    CardError
        For a LiDAR without sweeps, a sweep without a time a point, or a file that cannot be read.
    """
    files = []
    for index, name in enumerate(LIDARS):
        mine = list_bursts(drive, name)
        if not mine:
            raise CardError(
                f"session drive without sweeps of {name}", where=drive / name, wanted="<t_ns>.laz"
            )
        files += [(path, index, number) for number, path in enumerate(mine)]
    with ThreadPoolExecutor(max(threads, 1)) as pool:
        sweeps = list(pool.map(lambda file: _read(file[0], file[1], file[2], limits, returns), files))
    sweeps.sort(key=lambda sweep: (sweep.end_ns, sweep.lidar))
    counts = [len(sweep.ring) for sweep in sweeps]
    return Rays(
        np.concatenate([sweep.points for sweep in sweeps]),
        np.concatenate([sweep.ring for sweep in sweeps]),
        np.concatenate([sweep.time_ns for sweep in sweeps]),
        np.repeat(np.array([sweep.lidar for sweep in sweeps], dtype=np.int8), counts),
        np.array([sweep.lidar for sweep in sweeps], dtype=np.int8),
        np.array([sweep.start_ns for sweep in sweeps], dtype=np.int64),
        np.array([sweep.end_ns for sweep in sweeps], dtype=np.int64),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )


@dataclass(frozen=True)
class _Sweep:
    lidar: int
    start_ns: int
    end_ns: int
    points: Array
    ring: NDArray[np.uint8]
    time_ns: NDArray[np.int64]


def _read(path: Path, lidar: int, number: int, limits: Limits, returns: int) -> _Sweep:
    burst = read_burst(path, intensity=False)
    if len(burst) > 1 and not np.any(burst.offset_ns != burst.offset_ns[0]):
        raise CardError(
            "sweep without a time for each point", where=path, found=f"{len(burst)} points of one time"
        )
    # An odd step takes every ring alike, whose number in a column is a power of two.
    step = max(1, len(burst) // returns) | 1
    taken = np.arange(number % step, len(burst), step)
    taken = taken[limits.keep(burst.points[taken])]
    return _Sweep(
        lidar, burst.t_ns, burst.end_ns, burst.points[taken], burst.ring[taken], burst.time_ns[taken]
    )
