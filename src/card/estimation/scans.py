"""The sweeps of a drive as points in the rig, each with its own time, in order of the sweeps' ends."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.estimation.deskew import turns_of
from card.estimation.deskew_kernel import corrected
from card.estimation.motion_compensation import compensate
from card.estimation.strapdown import Path as ImuPath
from card.geometry import apply, from_json, inverse
from card.recording.laz import read_burst

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Limits:
    """Which returns take part: range in metres, azimuth in degrees clockwise from ahead of the sensor."""

    min_range_m: float
    max_range_m: float
    azimuth_deg: tuple[float, float]

    def keep(self, points: Array) -> NDArray[np.bool_]:
        """Which points (N, 3) of the sensor frame lie inside (N,)."""
        squared = np.einsum("ni,ni->n", points, points)
        kept: NDArray[np.bool_] = (squared >= self.min_range_m**2) & (squared <= self.max_range_m**2)
        low, high = self.azimuth_deg
        if high - low < 360:
            azimuth = np.degrees(np.arctan2(points[:, 0], points[:, 1]))
            kept &= (azimuth - low) % 360 <= high - low
        return kept


@dataclass(frozen=True)
class Scan:
    """One sweep: points (N, 3) m in rig, each where the rig was at its own time time_ns (N,).

    compensated : the recording holds the sweep as seen from the rig's pose at end_ns already.
    """

    start_ns: int
    end_ns: int
    points: Array
    time_ns: NDArray[np.int64]
    compensated: bool

    def at_end(self, path: ImuPath) -> Array:
        """Points (N, 3) in the rig as it stood at the end of the path, whose last time is end_ns."""
        if self.compensated:
            return self.points
        knots = (path.t_ns - self.start_ns).astype(np.float64)
        pose = path.pose
        offsets = (self.time_ns - self.start_ns).astype(np.float64)
        return np.asarray(compensate(self.points, offsets, knots, inverse(pose[-1]) @ pose))


class Sweeps(Protocol):
    """Sweeps in order of their ends, wherever they are kept; lidar (S,), start_ns and end_ns (S,)."""

    lidar: NDArray[Any]
    start_ns: NDArray[np.int64]
    end_ns: NDArray[np.int64]

    def __len__(self) -> int: ...

    def __getitem__(self, i: int) -> Scan: ...

    def ahead(self, chosen: Iterable[int]) -> Iterator[tuple[int, Scan]]:
        """Sweeps in the given order."""


class Scans:
    """The sweeps of some LiDARs of a recording; lidar (S,), burst (S,), start_ns and end_ns (S,)."""

    def __init__(
        self,
        recording: Path,
        bursts: Any,
        calibration: Mapping[str, Any],
        sensors: Mapping[str, Any],
        lidars: Sequence[str],
        limits: Limits,
    ) -> None:
        """bursts : table of schema ``bursts``.  sensors : the section of recording.yaml."""
        lidar = np.array(bursts["lidar"].to_pylist(), dtype=object)
        start, end, burst = (bursts[name].to_numpy() for name in ("t_start_ns", "t_end_ns", "burst"))
        order = np.lexsort((burst, lidar.astype(str), end))
        order = order[np.isin(lidar[order], list(lidars))]
        if len(order) < 2:
            raise CardError(
                "too few sweeps", where=recording, found=len(order), wanted=f"of {', '.join(lidars)}"
            )
        self.lidar, self.burst, self.start_ns, self.end_ns = (
            lidar[order],
            burst[order],
            start[order],
            end[order],
        )
        files = bursts["file"].to_pylist()
        self._files = [recording / files[i] for i in order]
        self._rig_from = {name: from_json(calibration["extrinsics"][f"rig_from_{name}"]) for name in lidars}
        self._turns = {name: turns_of(calibration["lidar_corrections"].get(name)) for name in lidars}
        self._compensated = {name: bool(sensors.get(name, {}).get("deskewed", False)) for name in lidars}
        self._limits = limits

    def __len__(self) -> int:
        return len(self._files)

    def __getitem__(self, i: int) -> Scan:
        """One sweep, read from its file.

        Raises
        ------
        CardError
            For a file that cannot be read, or a sweep without a time a point that needs one.
        """
        burst = read_burst(self._files[i], intensity=False)
        name = str(self.lidar[i])
        if (
            not self._compensated[name]
            and len(burst) > 1
            and not np.any(burst.offset_ns != burst.offset_ns[0])
        ):
            raise CardError(
                "sweep without a time for each point",
                where=self._files[i],
                found=f"{len(burst)} points of one time",
                wanted="offset_ns a point, or deskewed: true in recording.yaml",
            )
        points = np.asarray(corrected(burst.points, burst.ring, self._turns[name]))
        kept = self._limits.keep(points)
        in_rig = apply(self._rig_from[name], points[kept])
        return Scan(burst.t_ns, int(self.end_ns[i]), in_rig, burst.time_ns[kept], self._compensated[name])

    def ahead(self, chosen: Iterable[int]) -> Iterator[tuple[int, Scan]]:
        """Sweeps in the given order, the next one being read while the caller works."""
        with ThreadPoolExecutor(1) as reader:
            pending = None
            for i in chosen:
                following = (i, reader.submit(self.__getitem__, i))
                if pending is not None:
                    yield pending[0], pending[1].result()
                pending = following
            if pending is not None:
                yield pending[0], pending[1].result()
