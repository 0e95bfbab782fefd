"""Sums over the points of a profile, compiled."""

from typing import Any

import numba
import numpy as np

# Floating point in the order written, so that the plain form agrees bit by bit.
_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def residual(first: Any, basis: Any, across: Any, height: Any, coefficients: Any) -> Any:
    """Heights (N,) over splines of coefficients (K, 2), elevation and tilt.

    first : (N,) int64 coefficient at which the four alive ones begin. basis : (N, 4). across, height : (N,).
    """
    found = np.empty(len(first))
    for n in range(len(first)):
        value = 0.0
        for k in range(4):
            i = first[n] + k
            value += basis[n, k] * (coefficients[i, 0] + across[n] * coefficients[i, 1])
        found[n] = height[n] - value
    return found


@_compiled
def sums(first: Any, basis: Any, across: Any, height: Any, weights: Any, pieces: int) -> Any:
    """Sums over the points of each of P knot intervals.

    Returns (3, 10, P): of weight B_a B_b across^m, for m in 0..2 and the pairs a <= b; and (2, 4, P): of
    weight B_a height across^m, for m in 0..1.
    """
    products = np.zeros((3, 10, pieces))
    right = np.zeros((2, 4, pieces))
    for n in range(len(first)):
        if weights[n] == 0.0:
            continue
        i = first[n]
        pair = 0
        for a in range(4):
            weighted = weights[n] * basis[n, a]
            right[0, a, i] += weighted * height[n]
            right[1, a, i] += weighted * across[n] * height[n]
            for b in range(a, 4):
                both = weighted * basis[n, b]
                for m in range(3):
                    products[m, pair, i] += both
                    both = both * across[n]
                pair += 1
    return products, right


@_compiled
def moved(coefficients: Any, before: Any, tolerance_m: float) -> Any:
    """Whether the four coefficients (K, 2) alive in an interval differ from those before (P, 2, 4), by a
    tolerance or more in any, (P,)."""
    found = np.zeros(len(before), dtype=np.bool_)
    for i in range(len(before)):
        for k in range(4):
            for m in range(2):
                if np.abs(coefficients[i + k, m] - before[i, m, k]) >= tolerance_m:
                    found[i] = True
    return found
