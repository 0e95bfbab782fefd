"""Which sweep of the front LiDAR belongs to a view of the board."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from card.artifacts import progress
from card.errors import CardError
from card.recording.burst import Burst
from card.recording.laz import read_burst
from card.recording.paths import list_bursts, stamp_of

LIDAR = "lidar_front"


def sweeps_of(session: Path, t_ns: Sequence[int]) -> Iterator[Burst | None]:
    """The sweep during which each time lies; None where there is none.

    Raises
    ------
    CardError
        If the session has no sweeps.
    """
    files = list_bursts(session, LIDAR)
    if not files:
        raise CardError("session has no sweeps of the board", where=session, wanted=f"{LIDAR}/<t_ns>.laz")
    starts = np.array([stamp_of(file) for file in files], dtype=np.int64)
    for time in progress(t_ns, f"board returns of {session.name}", len(t_ns)):
        before = int(np.searchsorted(starts, time, side="right")) - 1
        burst = read_burst(files[before]) if before >= 0 else None
        yield burst if burst is not None and time <= burst.end_ns else None
