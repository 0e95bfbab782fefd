"""Banded equations brought up to date: the bits of a solution from scratch, and scipy's numbers."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, solveh_banded

from card.wheels.banded_kernels import factorize, inverse, substitute

Array = NDArray[np.float64]
COUNT, WIDTH = 90, 8


def columns(rng: np.random.Generator, count: int) -> Array:
    """Columns (C, 8) of a positive definite band, most of whose places beside the diagonal are empty."""
    band = rng.uniform(-1, 1, (count, WIDTH)) * (rng.uniform(size=(count, WIDTH)) < 0.12)
    band[:, 0] = rng.uniform(16, 20, count)
    return band


class System:
    """A band (n, 8) and a right side (n,), with what is kept of their solution."""

    def __init__(self, band: Array, right: Array) -> None:
        self.band, self.right = band.copy(), right.copy()
        self.factor, self.forward, self.solution = np.zeros_like(band), np.zeros(COUNT), np.zeros(COUNT)
        self.renew(np.ones(COUNT, dtype=bool))

    def renew(self, written: NDArray[np.bool_]) -> None:
        changed = written.copy()
        assert factorize(self.band, changed, self.factor)
        substitute(self.factor, self.right, written, changed, self.forward, self.solution)


@pytest.mark.parametrize("seed", range(20))
def test_a_system_brought_up_to_date_is_one_from_scratch(seed: int) -> None:
    rng = np.random.default_rng(seed)
    system = System(columns(rng, COUNT), rng.normal(size=COUNT))
    for _ in range(8):
        written = rng.uniform(size=COUNT) < 0.04
        system.band[written] = columns(rng, np.count_nonzero(written))
        system.right[written] = rng.normal(size=np.count_nonzero(written))
        system.renew(written)
        anew = System(system.band, system.right)
        for name in ("factor", "forward", "solution"):
            np.testing.assert_array_equal(getattr(system, name), getattr(anew, name))
    wanted = solveh_banded(system.band.T, system.right, lower=True)
    np.testing.assert_allclose(system.solution, wanted, rtol=0, atol=1e-14)


def test_factor_and_inverse_are_those_of_the_matrix() -> None:
    rng = np.random.default_rng(0)
    system = System(columns(rng, COUNT), rng.normal(size=COUNT))
    matrix = np.zeros((COUNT, COUNT))
    for i in range(WIDTH):
        matrix += np.diag(system.band[: COUNT - i, i], -i) + (i > 0) * np.diag(system.band[: COUNT - i, i], i)
    factor, found = cholesky_banded(system.band.T, lower=True), inverse(system.factor)
    for i in range(WIDTH):
        np.testing.assert_allclose(system.factor[: COUNT - i, i], factor[i, : COUNT - i], atol=1e-13)
        np.testing.assert_allclose(
            found[: COUNT - i, i], np.diagonal(np.linalg.inv(matrix), -i), rtol=0, atol=1e-14
        )


@pytest.mark.parametrize("value", [0.0, -3.0, np.nan])
def test_a_matrix_that_is_not_positive_definite_is_told(value: float) -> None:
    band = columns(np.random.default_rng(1), COUNT)
    band[50, 0] = value
    assert not factorize(band, np.ones(COUNT, dtype=bool), np.zeros_like(band))
