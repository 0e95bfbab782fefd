"""The wheels' spline against Ceres, which the paper fits it with."""

import sys
from pathlib import Path

import numpy as np
import pytest

from card.wheels.profile import fit_profile

pytest.importorskip("pyceres")
sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from ceres_reference import OFF_M, ceres_coefficients, corridor, wheel_settings


@pytest.mark.parametrize("length_m", [15.0, pytest.param(500.0, marks=pytest.mark.slow)])
def test_ceres_finds_the_same_minimum(length_m: float) -> None:
    """To 10 um from 1 mm beside it; a minute's drive is the full size."""
    settings = wheel_settings()
    arc, sideways, height = corridor(length_m)
    profile, _, weight = fit_profile(arc, sideways, height, settings)
    assert 0.05 < np.mean(weight == 0) < 0.2
    witness = ceres_coefficients(arc, sideways, height, profile, settings)
    assert not np.array_equal(witness, profile.coefficients + OFF_M)
    np.testing.assert_allclose(profile.coefficients, witness, atol=1e-5)
