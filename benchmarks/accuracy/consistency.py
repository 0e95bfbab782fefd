"""Whether the sigmas of the calibration tell its errors, over simulated sessions of their own."""

from collections.abc import Sequence
from pathlib import Path

from board_sessions import SMALL, consistency_row, normalised_errors
from rows import Row

SEEDS = 8


def rows(_work: Path, _truth: Path, _sequences: Sequence[str]) -> list[Row]:
    """Row `consistency_pct`; benchmarks/board_sessions.py has it over as many seeds as one likes."""
    return [consistency_row(normalised_errors(SEEDS, *SMALL))]
