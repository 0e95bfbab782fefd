"""What the benchmarks say of work in a process of its own."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from own_process import alone


def spend(megabytes: int) -> int:
    """Fill so much memory, and let a child compute for a fifth of a second."""
    filled = np.ones(megabytes * 125_000)
    code = "import time\nwhile time.process_time() < 0.2: pass"
    subprocess.run([sys.executable, "-c", code], check=True)
    return int(filled.nbytes)


def test_a_process_of_its_own_is_measured_alone() -> None:
    mine = np.ones(50_000_000)
    found, spent = alone(spend, 100)
    assert found == 100_000_000
    # Neither the memory of the process that starts it, nor the time of what it started itself.
    assert 0.1 < spent.peak_gb < 0.3 < mine.nbytes / 1e9
    assert spent.children_s == pytest.approx(0.2, abs=0.1)
    assert spent.wall_s >= 0.2


def test_what_fails_there_fails_here() -> None:
    with pytest.raises(MemoryError):
        alone(spend, 10**10)
