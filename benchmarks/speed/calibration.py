"""What a calibration session costs, from few images and views; benchmarks/session_time.py takes all."""

from pathlib import Path

import session_time
from rows import Row

PAIRS, VIEWS = 6, 60


def rows(scratch: Path, _repeats: int) -> list[Row]:
    """Row `session_s`, the CPU-seconds of 500 stereo pairs shared out to two cores, and each step's share."""
    return session_time.rows(scratch, PAIRS, VIEWS)
