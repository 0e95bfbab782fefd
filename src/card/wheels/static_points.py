"""Which points lie in the static voxels of a sequence."""

from collections.abc import Mapping
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from card.wheels import voxel_kernels

Array = NDArray[np.float64]


@cache
def _steps(reach: int) -> NDArray[np.int64]:
    """The steps (S, 3) to the voxels at most `reach` off, the near ones first."""
    steps = product(range(-reach, reach + 1), repeat=3)
    return np.array(sorted(steps, key=lambda step: (np.abs(step).sum(), step)), dtype=np.int64)


class StaticVoxels:
    """The voxel set of schema ``static_voxels``: origin (3,), voxel_size in metres, ids (V, 3)."""

    def __init__(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        self._origin = np.asarray(arrays["origin"], dtype=np.float64)
        self._size = float(arrays["voxel_size"])
        ids = np.asarray(arrays["ids"]).reshape(-1, 3)
        some = len(ids) > 0
        self._low = np.array([column.min() if some else 0 for column in ids.T], dtype=np.int64)
        high = np.array([column.max() if some else -1 for column in ids.T], dtype=np.int64)
        self._extent = high - self._low + 1
        keys = np.asarray(voxel_kernels.keys(ids, self._low, self._extent))
        # Ten million are sorted in a second; as they are written they are in order.
        self._keys = keys if (keys[1:] > keys[:-1]).all() else np.sort(keys)

    def near(self, points: Array, reach: int, compiled: bool = True) -> NDArray[np.bool_]:
        """Whether each of the points (N, 3), metres in world, lies at most `reach` voxels off a static one.

        A reach of 0 is the voxel set itself; 1 also takes the voxels that touch it. compiled : whether they
        are looked up in machine code; the plain form finds the same.
        """
        voxel = np.floor((points - self._origin) / self._size).astype(np.int64) - self._low
        steps = _steps(reach)
        if compiled:
            return np.asarray(voxel_kernels.any_among(voxel, steps, self._extent, self._keys))
        found = np.zeros(len(points), dtype=bool)
        for step in steps:
            missing = np.flatnonzero(~found)
            found[missing] = self._contain(voxel[missing] + step)
        return found

    def _contain(self, voxel: NDArray[np.int64]) -> NDArray[np.bool_]:
        within = np.all((voxel >= 0) & (voxel < self._extent), axis=1)
        if not within.any():
            return within
        x, y, z = voxel[within].T
        keys = (x * self._extent[1] + y) * self._extent[2] + z
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        within[within] = self._keys[at] == keys
        return within
