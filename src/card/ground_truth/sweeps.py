"""The bursts of a drive as world points: read, cropped, motion-compensated (paper, supplement A)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts import read_table
from card.errors import CardError
from card.estimation.deskew import deskew_burst
from card.geometry import Trajectory, from_json
from card.recording.burst import Burst
from card.recording.description import read_description
from card.recording.laz import read_burst
from card.recording.paths import LIDARS

FRONT, REAR = LIDARS
#: World points kept between passes over the drive; a short one is then read only once.
CACHE_POINTS = 30_000_000


@dataclass(frozen=True)
class Sweep:
    """The points of a burst that take part.

    points: (N, 3) float64 world, metres. time_ns: (N,) int64. ring: (N,) uint8.
    at_origin, cropped: points dropped because they lie at the sensor's origin, or by the crop.
    """

    points: npt.NDArray[np.float64]
    time_ns: npt.NDArray[np.int64]
    ring: npt.NDArray[np.uint8]
    at_origin: int
    cropped: int


class Drive:
    """The bursts of both LiDARs in the fixed order (end time, sensor, index), read when asked for.

    start_ns, end_ns: (B,) int64. front: (B,) bool. index: (B,) int32, number among its sensor's bursts.
    origins: (B, 3) float64, world, metres: where the sensor was at the burst's end.
    """

    def __init__(
        self,
        recording: Path,
        bursts: Path,
        calibration: Mapping[str, Any],
        trajectory: Trajectory,
        settings: Mapping[str, Any],
    ) -> None:
        table = read_table(bursts, "bursts")
        lidar = np.array(table["lidar"].to_pylist(), dtype=object)
        columns = {name: table[name].to_numpy() for name in ("t_start_ns", "t_end_ns", "burst")}
        order = np.lexsort((columns["burst"], lidar == REAR, columns["t_end_ns"]))
        self.front: npt.NDArray[np.bool_] = (lidar == FRONT)[order]
        self.start_ns, self.end_ns, self.index = (column[order] for column in columns.values())
        files = table["file"].to_pylist()
        self.files = [recording / files[i] for i in order]
        self.trajectory = trajectory
        self._settings = settings
        self._rig_from = {s: from_json(calibration["extrinsics"][f"rig_from_{s}"]) for s in LIDARS}
        self._corrections = calibration["lidar_corrections"]
        description = read_description(recording)
        self.id: str = description["id"]
        sensors = description["sensors"]
        self._deskewed = {s: bool(sensors.get(s, {}).get("deskewed", False)) for s in LIDARS}
        self._check(bursts)
        rig_origins = np.array([self._rig_from[self.sensor(i)][:3, 3] for i in range(len(self))])
        poses = trajectory.at(self.end_ns)
        self.origins = np.einsum("bij,bj->bi", poses[:, :3, :3], rig_origins.reshape(-1, 3)) + poses[:, :3, 3]
        self._cache: OrderedDict[int, Sweep] = OrderedDict()
        self._cached_points, self._limit, self._sliding = 0, CACHE_POINTS, False

    def __len__(self) -> int:
        return len(self.files)

    def sensor(self, i: int) -> str:
        """Name of the LiDAR of burst `i`."""
        return FRONT if self.front[i] else REAR

    def of(self, front: bool) -> npt.NDArray[np.int64]:
        """Ordinals of one LiDAR's bursts, in order."""
        return np.flatnonzero(self.front == front)

    def poses(self, i: int, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """world_from_lidar (M, 4, 4) of the sensor of burst `i` at times (M,)."""
        return self.trajectory.at(t_ns) @ self._rig_from[self.sensor(i)]

    def sweep(self, i: int) -> Sweep:
        """The world points of burst `i`."""
        if i in self._cache:
            self._cache.move_to_end(i)
            return self._cache[i]
        sweep = self._read(i)
        # What one pass over a long drive leaves would be pushed out before the next pass comes to it.
        room = self._cached_points + len(sweep.points) <= self._limit
        if self.front[i] if self._sliding else room:
            self._cache[i] = sweep
            self._cached_points += len(sweep.points)
            self._push_out()
        return sweep

    def keep(self, points: int) -> None:
        """From now on keep no more than this many world points in memory, of the front bursts last asked for.

        A keyframe is one of them. Until then passes over the whole drive are expected, and what comes first
        is kept.
        """
        self._limit, self._sliding = points, True
        self._push_out()

    def _push_out(self) -> None:
        while self._cached_points > self._limit and len(self._cache) > 1:
            self._cached_points -= len(self._cache.popitem(last=False)[1].points)

    def _read(self, i: int) -> Sweep:
        burst, lidar = read_burst(self.files[i], intensity=False), self.sensor(i)
        real, inside = self._takes_part(i, burst)
        keep = real & inside
        part = replace(
            burst,
            points=burst.points[keep],
            intensity=burst.intensity[keep],
            ring=burst.ring[keep],
            offset_ns=burst.offset_ns[keep],
        )
        world = self._world(part, lidar, int(self.end_ns[i]))
        return Sweep(world, part.time_ns, part.ring, int((~real).sum()), int((real & ~inside).sum()))

    def _takes_part(self, i: int, burst: Burst) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Points (N,) of burst `i` that are not at the sensor's origin, and those that the crop keeps."""
        x, y, z = burst.points.T
        real = np.sqrt(x * x + y * y + z * z) >= self._settings["min_range_m"]
        mode = self._settings["front_crop" if self.front[i] else "rear_crop"]
        return real, _crop(burst.points, mode, self._rig_from[self.sensor(i)])

    def _world(self, burst: Burst, lidar: str, end_ns: int) -> npt.NDArray[np.float64]:
        return deskew_burst(
            burst,
            self._rig_from[lidar],
            self.trajectory,
            self._corrections[lidar],
            motion_compensate=not self._deskewed[lidar],
            end_ns=end_ns,
        )

    def _check(self, bursts: Path) -> None:
        outside = np.flatnonzero(
            (self.start_ns < self.trajectory.start_ns) | (self.end_ns > self.trajectory.end_ns)
        )
        if len(outside):
            i = outside[0]
            raise CardError(
                f"poses do not cover {len(outside)} bursts",
                where=self.files[i],
                found=f"poses {self.trajectory.start_ns}..{self.trajectory.end_ns} ns",
                wanted=f"{self.start_ns[i]}..{self.end_ns[i]} ns",
            )
        for front in (True, False):
            step = np.diff(self.start_ns[self.of(front)])
            if (step == 0).any():
                raise CardError(
                    "two bursts start at the same time", where=bursts, found=int((step == 0).sum()), wanted=0
                )
            if (step < 0).any():
                raise CardError(
                    "a burst lies within another of its LiDAR",
                    where=self.files[self.of(front)[int(np.argmin(step)) + 1]],
                    wanted="one burst after the other",
                )


def _crop(
    points: npt.NDArray[np.float64], mode: str, rig_from_lidar: npt.NDArray[np.float64]
) -> npt.NDArray[np.bool_]:
    """Points (N, 3) in the sensor frame that lie in the half-space that `mode` keeps."""
    if mode == "none":
        return np.ones(len(points), dtype=np.bool_)
    if mode == "forward":
        ahead: npt.NDArray[np.bool_] = points[:, 1] >= 0
        return ahead
    # The rear sensor may be mounted either way round: behind means behind in the rig.
    behind: npt.NDArray[np.bool_] = points @ rig_from_lidar[1, :3] < 0
    return behind
