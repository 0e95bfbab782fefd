"""Normal equations of the two splines of a profile: banded, summed up interval by interval."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from card.wheels import banded_kernels, spline_kernels

Array = NDArray[np.float64]
#: Keeps a piece of spline that no point touches solvable; far below what a single point weighs.
RIDGE = 1e-9
#: Elevation and tilt of one place are neighbours among the unknowns: four places make eight diagonals.
BAND = 8


def uniform_basis(
    arc: ArrayLike, start_m: float, spacing_m: float, count: int
) -> tuple[NDArray[np.int64], Array]:
    """First coefficient (...) and values (..., 4) of the four cubic B-splines alive at each arc length."""
    position = (np.asarray(arc, dtype=np.float64) - start_m) / spacing_m
    first = np.clip(np.floor(position).astype(np.int64), 0, count - 4)
    u = position - first
    v = 1 - u
    basis = np.stack([v**3, 3 * u**3 - 6 * u**2 + 4, 3 * v**3 - 6 * v**2 + 4, u**3], axis=-1) / 6
    return first, basis


class NormalEquations:
    """Weighted least squares of heights (N,) over splines of K = `count` coefficients in elevation and tilt.

    The unknowns are ordered elevation 0, tilt 0, elevation 1, tilt 1 and so on. across : (N,) where a point
    lies in the corridor, from -1 at its left edge to 1 at its right one.
    """

    def __init__(
        self,
        arc: Array,
        across: Array,
        height: Array,
        start_m: float,
        spacing_m: float,
        count: int,
        compiled: bool,
    ) -> None:
        self._first, self._basis = uniform_basis(arc, start_m, spacing_m, count)
        self._across, self._height, self._count = across, height, count
        self._kernels = spline_kernels if compiled else PlainKernels
        #: Where the points of each interval begin, and where the last ones end.
        self._begin = np.searchsorted(self._first, np.arange(count - 2))
        self._products, self._sums = np.zeros((3, 10, count - 3)), np.zeros((2, 4, count - 3))
        self._band, self._factor = np.zeros((2 * count, BAND)), np.zeros((2 * count, BAND))
        self._right, self._forward, self._solution = np.zeros((3, 2 * count))
        self._compiled = compiled
        #: The intervals weighed since, and the penalties of, the last solution.
        self._weighed: NDArray[np.bool_] = np.ones(count - 3, dtype=np.bool_)
        self._penalties: tuple[float, float] | None = None

    def points(self, intervals: NDArray[np.bool_]) -> NDArray[np.int64] | slice:
        """The points that lie in the chosen ones (K - 3,) of the knot intervals."""
        if intervals.all():
            return slice(None)
        begin, size = self._begin[:-1][intervals], np.diff(self._begin)[intervals]
        return np.arange(size.sum()) + np.repeat(begin - np.cumsum(size) + size, size)

    def weigh(self, weights: Array, intervals: NDArray[np.bool_]) -> None:
        """Sum up the points of the chosen intervals (K - 3,) with weights (P,); the other sums stay."""
        first, basis, across, height = self._part(self.points(intervals))
        among_chosen = np.cumsum(intervals) - 1
        points = (among_chosen[first], basis, across, height, weights)
        sums = self._kernels.sums(*points, int(np.count_nonzero(intervals)))
        self._products[..., intervals], self._sums[..., intervals] = sums
        self._weighed |= intervals

    def moved(self, coefficients: Array, before: Array, tolerance_m: float) -> NDArray[np.bool_]:
        """The intervals (K - 3,) whose alive coefficients differ from those before (K - 3, 2, 4)."""
        found: NDArray[np.bool_] = self._kernels.moved(coefficients, before, tolerance_m)
        return found

    def residual(self, coefficients: Array, chosen: NDArray[np.int64] | slice) -> Array:
        """Heights (P,) of the chosen points over the splines of coefficients (K, 2)."""
        found: Array = self._kernels.residual(*self._part(chosen), coefficients)
        return found

    def _part(self, chosen: NDArray[np.int64] | slice) -> tuple[NDArray[np.int64], Array, Array, Array]:
        return self._first[chosen], self._basis[chosen], self._across[chosen], self._height[chosen]

    def solve(self, penalty: float, tilt_penalty: float) -> Array:
        """Coefficients (K, 2).

        Raises
        ------
        LinAlgError
            If the weights are no weights, so that the equations are not positive definite.
        """
        if (penalty, tilt_penalty) != self._penalties:
            self._weighed[:] = True
        if not self._compiled:  # from scratch
            self._weighed[:] = True
            for array in (self._factor, self._forward, self._solution):
                array[:] = np.nan
        sums = self._products, self._sums
        written = banded_kernels.assemble(
            *sums, penalty, tilt_penalty, RIDGE, self._weighed, self._band, self._right
        )
        self._penalties, self._weighed[:] = (penalty, tilt_penalty), False
        changed = written.copy()
        if not banded_kernels.factorize(self._band, changed, self._factor):
            raise np.linalg.LinAlgError("normal equations are not positive definite")
        banded_kernels.substitute(self._factor, self._right, written, changed, self._forward, self._solution)
        return self._solution.reshape(self._count, 2).copy()

    def variance(self) -> Array:
        """Covariances (K, 4) of the last elevation coefficients with themselves and the next three."""
        return np.ascontiguousarray(banded_kernels.inverse(self._factor)[::2, ::2])


class PlainKernels:
    """`spline_kernels` in numpy, in the same order: what the compiled form is held to."""

    @staticmethod
    def residual(
        first: NDArray[np.int64], basis: Array, across: Array, height: Array, coefficients: Array
    ) -> Array:
        """See `spline_kernels.residual`."""
        value = np.zeros(len(first))
        for k in range(4):
            here = coefficients[first + k]
            value += basis[:, k] * (here[:, 0] + across * here[:, 1])
        return height - value

    @staticmethod
    def sums(
        first: NDArray[np.int64], basis: Array, across: Array, height: Array, weights: Array, pieces: int
    ) -> tuple[Array, Array]:
        """See `spline_kernels.sums`."""
        products, right = np.zeros((3, 10, pieces)), np.zeros((2, 4, pieces))
        pair = 0
        for a in range(4):
            weighted = weights * basis[:, a]
            right[0, a] = np.bincount(first, weighted * height, minlength=pieces)
            right[1, a] = np.bincount(first, weighted * across * height, minlength=pieces)
            for b in range(a, 4):
                both = weighted * basis[:, b]
                for m in range(3):
                    products[m, pair] = np.bincount(first, both, minlength=pieces)
                    both = both * across
                pair += 1
        return products, right

    @staticmethod
    def moved(coefficients: Array, before: Array, tolerance_m: float) -> NDArray[np.bool_]:
        """See `spline_kernels.moved`."""
        alive = sliding_window_view(coefficients, 4, axis=0)
        return np.asarray((np.abs(alive - before) >= tolerance_m).any(axis=(1, 2)))
