"""Banded normal equations that are solved anew only where they changed, compiled.

A symmetric band is (n, b): entry (j, i) is element (j + i, j) of the matrix, its Cholesky factor likewise. In
every step a column depends on those less than b before it (in back substitution: after it), and forgets them
along the road: behind a change the new values soon equal the old ones to the last bit, and all that follows
stays as it is. The result has the bits of a solution from scratch.
"""

from typing import Any

import numba
import numpy as np

_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def assemble(
    products: Any,
    sums: Any,
    penalty: float,
    tilt_penalty: float,
    ridge: float,
    changed: Any,
    band: Any,
    right: Any,
) -> Any:
    """Put sums over the points of P intervals (`spline_kernels.sums`) and penalties into band and right side.

    changed : (P,) whose sums changed since the last time. band : (2 K, 8), right : (2 K,) of K = P + 3
    coefficients in elevation and tilt, taken in turns. Returns which columns (2 K,) were written.
    """
    pieces = len(changed)
    count = pieces + 3
    written, last = np.zeros(2 * count, dtype=np.bool_), -4
    difference = (1.0, -2.0, 1.0)
    for k in range(count):
        if k < pieces and changed[k]:
            last = k
        if k - last > 3:
            continue
        written[2 * k : 2 * k + 2] = True
        low, high = max(0, k - pieces + 1), min(3, k)
        for m in range(2):
            total = 0.0
            for a in range(low, high + 1):
                total += sums[m, a, k - a]
            right[2 * k + m] = total
        band[2 * k : 2 * k + 2] = 0.0
        for d in range(4):
            for a in range(low, min(high, 3 - d) + 1):
                pair = 4 * a - a * (a - 1) // 2 + d
                band[2 * k, 2 * d] += products[0, pair, k - a]
                band[2 * k, 2 * d + 1] += products[1, pair, k - a]
                if d > 0:
                    band[2 * k + 1, 2 * d - 1] += products[1, pair, k - a]
                band[2 * k + 1, 2 * d] += products[2, pair, k - a]
        for d in range(3):
            for a in range(max(0, k - count + 3), min(2 - d, k) + 1):
                band[2 * k, 2 * d] += penalty * difference[a] * difference[a + d]
        band[2 * k, 0] += ridge
        band[2 * k + 1, 0] += tilt_penalty
        band[2 * k + 1, 0] += ridge
    return written


@_compiled
def factorize(band: Any, changed: Any, factor: Any) -> bool:
    """Bring the lower Cholesky factor of a band (n, b) up to date; whether the matrix is positive definite.

    changed : (n,) columns of the band that changed since the last time; afterwards those of the factor.
    """
    n, width = band.shape
    column, last = np.empty(width), -width
    for j in range(n):
        if not changed[j] and j - last >= width:
            continue
        changed[j] = False
        for i in range(min(width, n - j)):
            total = band[j, i]
            for k in range(max(0, j + i - width + 1), j):
                total -= factor[k, j - k] * factor[k, j + i - k]
            column[i] = total
        if not column[0] > 0.0:
            return False
        root = np.sqrt(column[0])
        for i in range(min(width, n - j)):
            value = root if i == 0 else column[i] / root
            if value != factor[j, i]:
                factor[j, i] = value
                changed[j], last = True, j
    return True


@_compiled
def substitute(factor: Any, right: Any, written: Any, changed: Any, forward: Any, solution: Any) -> None:
    """Bring the solution (n,) of a factorized system up to date, and `forward`, that of the lower factor.

    written, changed : (n,) the right sides and the columns of the factor that changed since the last time.
    """
    n, width = factor.shape
    moved, last = np.zeros(n, dtype=np.bool_), -width
    for j in range(n):
        if changed[j]:
            last = j
        if not written[j] and j - last >= width:
            continue
        total = right[j]
        for k in range(max(0, j - width + 1), j):
            total -= factor[k, j - k] * forward[k]
        value = total / factor[j, 0]
        if value != forward[j]:
            forward[j] = value
            moved[j], last = True, j
    last = n + width
    for j in range(n - 1, -1, -1):
        if not (moved[j] or changed[j]) and last - j >= width:
            continue
        total = forward[j]
        for i in range(1, min(width, n - j)):
            total -= factor[j, i] * solution[j + i]
        value = total / factor[j, 0]
        if value != solution[j]:
            solution[j] = value
            last = j


@_compiled
def inverse(factor: Any) -> Any:
    """The entries (n, b) of the inverse that lie in the band, by the factor (n, b).

    Takahashi's recurrence, from the last column to the first.
    """
    n, width = factor.shape
    found = np.zeros((n, width))
    for j in range(n - 1, -1, -1):
        last = min(width - 1, n - 1 - j)
        for i in range(last, -1, -1):
            total = 1.0 / factor[j, 0] if i == 0 else 0.0
            for k in range(1, last + 1):
                low, high = min(i, k), max(i, k)
                total -= factor[j, k] * found[j + low, high - low]
            found[j, i] = total / factor[j, 0]
    return found
