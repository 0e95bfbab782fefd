"""The voxels that rays cross, in plain numpy: every face of the grid, one ray at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def crossed_voxels(origin: Floats, direction: Floats, near: float, far: float) -> npt.NDArray[np.int64]:
    """World indices (K, 3) of the voxels that a ray crosses from `near` to `far`, all in voxels."""
    if far <= near:
        return np.empty((0, 3), dtype=np.int64)
    cuts = [np.array([near, far])]
    for start, step in zip(origin, direction, strict=True):
        if step:
            low, high = sorted((start + near * step, start + far * step))
            cuts.append((np.arange(np.ceil(low), np.floor(high) + 1) - start) / step)
    along = np.sort(np.concatenate(cuts))
    middle = (along[1:] + along[:-1]) / 2
    return np.floor(origin + middle[:, None] * direction).astype(np.int64)
