"""Voxels as keys, and points among them, compiled."""

from typing import Any

import numba
import numpy as np

_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def keys(ids: Any, low: Any, extent: Any) -> Any:
    """One number (V,) int64 for each voxel (V, 3) of a box of this extent (3,) from the lowest voxel (3,)."""
    found = np.empty(len(ids), dtype=np.int64)
    for n in range(len(ids)):
        i, j, k = ids[n, 0] - low[0], ids[n, 1] - low[1], ids[n, 2] - low[2]
        found[n] = (i * extent[1] + j) * extent[2] + k
    return found


@_compiled
def any_among(voxel: Any, steps: Any, extent: Any, keys: Any) -> Any:
    """Whether a voxel (N, 3) moved by any of the steps (S, 3) lies in the extent and is among the keys."""
    found = np.zeros(len(voxel), dtype=np.bool_)
    for n in range(len(voxel)):
        for s in range(len(steps)):
            i, j, k = voxel[n, 0] + steps[s, 0], voxel[n, 1] + steps[s, 1], voxel[n, 2] + steps[s, 2]
            if not (0 <= i < extent[0] and 0 <= j < extent[1] and 0 <= k < extent[2]):
                continue
            key = (i * extent[1] + j) * extent[2] + k
            low, high = 0, len(keys)
            while low < high:
                middle = (low + high) // 2
                if keys[middle] < key:
                    low = middle + 1
                else:
                    high = middle
            if low < len(keys) and keys[low] == key:
                found[n] = True
                break
    return found
