"""Are a LiDAR's bursts sound, and when do they begin and end?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from card.artifacts import progress
from card.errors import CardError
from card.recording.laz import read_burst


@dataclass(frozen=True)
class BurstTimes:
    """The bursts of one LiDAR in order of time: start_ns, end_ns, points, (N,) int64 each."""

    start_ns: npt.NDArray[np.int64]
    end_ns: npt.NDArray[np.int64]
    points: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.start_ns)


def check_bursts(lidar: str, paths: Sequence[Path], overlap_ns: int) -> BurstTimes:
    """Read every burst of a LiDAR, one at a time.

    Raises CardError, naming the file, for a burst that `read_burst` refuses, that has no points, or
    that begins more than `overlap_ns` before the one before has ended.
    """
    rows: list[tuple[int, int, int]] = []
    for path in progress(paths, f"check {lidar}"):
        burst = read_burst(path)
        if not len(burst):
            raise CardError("burst without points", where=path)
        if rows and burst.t_ns < rows[-1][1] - overlap_ns:
            raise CardError(
                f"times of {lidar} go back",
                where=path,
                found=f"starts {(rows[-1][1] - burst.t_ns) / 1e6:.3f} ms before the burst before it ends",
                wanted="one burst after the other",
            )
        rows.append((burst.t_ns, burst.end_ns, len(burst)))
    columns = np.array(rows, dtype=np.int64).reshape(-1, 3).T
    return BurstTimes(*columns)


def refuse_copies(lidar: str, inventory: dict[str, list[str]]) -> None:
    """Raises CardError when two bursts of a LiDAR hold the same bytes under different times.

    inventory: columns name and sha256 of the recording's files.
    """
    first: dict[str, str] = {}
    for name, sha256 in zip(inventory["name"], inventory["sha256"], strict=True):
        if not name.startswith(f"{lidar}/"):
            continue
        if sha256 in first:
            raise CardError("duplicate burst", where=name, found=f"the same as {first[sha256]}")
        first[sha256] = name
