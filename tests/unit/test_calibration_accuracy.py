"""Cameras and front LiDAR against the truth over simulated sessions: errors, and whether sigmas tell them."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from board_sessions import AIMS, mean_normalised, normalised_errors, session_errors


def check_consistent(seeds: int, boards: int, columns: int) -> None:
    for name, (mean, low, high) in mean_normalised(normalised_errors(seeds, boards, columns)).items():
        print(f"{name}: mean normalised error squared {mean:.3f}, 95 % interval {low:.3f} to {high:.3f}")
        assert low <= mean <= high, name


def test_covariances_neither_boast_nor_hide() -> None:
    check_consistent(8, 24, 200)


@pytest.mark.slow
def test_covariances_neither_boast_nor_hide_over_a_hundred_seeds() -> None:
    check_consistent(100, 24, 200)


def check_exact(seeds: int, boards: int, columns: int) -> None:
    errors = [session_errors(seed, boards, columns) for seed in range(1, seeds + 1)]
    for figure, aim in AIMS.items():
        values = [one[figure] for one in errors]
        print(f"{figure}: median {np.median(values):.4f}, p95 {np.percentile(values, 95):.4f}, aim {aim}")
        assert np.median(values) <= aim, figure


def test_a_session_of_150_boards_is_exact() -> None:
    check_exact(1, 150, 200)


@pytest.mark.slow
def test_sessions_of_150_boards_are_exact_over_five_seeds() -> None:
    check_exact(5, 150, 2000)
