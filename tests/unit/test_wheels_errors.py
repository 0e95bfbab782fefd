"""What the accuracy figures of the wheels count: walls and flagged samples apart."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from accuracy.wheels import figures
from tyre_ground import ground_under
from wheel_errors import WheelErrors


def ground(path: Path, run_m: float) -> Path:
    """A road 2 m wide that falls by 10 cm over `run_m` at y = 5 m."""
    y = np.array([0, 5, 5 + run_m, 10])
    z = np.array([0, 0, -0.1, -0.1])
    vertices = np.array([[x, a, b] for a, b in zip(y, z, strict=True) for x in (-1.0, 1.0)])
    triangles = [[i, i + 1, i + 2] for i in range(len(vertices) - 2)]
    np.savez(path, vertices=vertices, triangles=np.array(triangles))
    return path


@pytest.mark.parametrize(("run_m", "expected"), [(0.02, True), (0.09, True), (0.2, False)])
def test_a_wall_is_steeper_than_45_degrees(tmp_path: Path, run_m: float, expected: bool) -> None:
    y = np.linspace(3, 7, 400)
    contacts = np.stack([np.zeros_like(y), y, np.where(y < 5, 0, -0.1)], axis=1)
    forward = np.tile([0.0, 2.0], (len(y), 1))
    crossed = ground_under(ground(tmp_path / "world.npz", run_m), contacts, forward).wall
    over = (y > 5 - 0.1) & (y < 5 + run_m + 0.1)
    away = (y < 5 - 0.14) | (y > 5 + run_m + 0.14)
    assert crossed[over].all() == expected
    assert not crossed[away].any()


def test_the_truth_is_the_mean_under_the_footprint(tmp_path: Path) -> None:
    """Over the foot of a slope of 1:2, whatever height the contact was said to have."""
    y = np.linspace(4.7, 5.3, 13)
    contacts = np.stack([np.zeros_like(y), y, np.full_like(y, 0.03)], axis=1)
    found = ground_under(ground(tmp_path / "world.npz", 0.2), contacts, np.tile([0.0, 1.0], (len(y), 1)))
    along = y[:, None] + (np.arange(2000) + 0.5) / 2000 * 0.24 - 0.12
    np.testing.assert_allclose(found.height, np.interp(along, [5, 5.2], [0, -0.1]).mean(axis=1), atol=1e-4)


def test_walls_and_flagged_samples_do_not_count_with_the_rest() -> None:
    no = np.zeros(6, dtype=bool)
    gap, uncertain, wall = no.copy(), no.copy(), no.copy()
    gap[1] = uncertain[1] = uncertain[2] = wall[3] = True
    found = figures(WheelErrors(np.array([1.0, 50.0, 40.0, -9.0, -2.0, 2.0]), gap, uncertain, wall))
    assert found["rms_mm"] == pytest.approx(np.sqrt(3))
    assert found["max_mm"] == 2
    assert found["walls_max_mm"] == 9
    assert found["gap_pct"] == found["uncertain_pct"] == pytest.approx(100 / 6)
