"""Outlier cleaning by the median absolute deviation in each voxel (paper, supplement D and main text)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from card.ground_truth.reference.runs import runs_by_voxel

_LOW = (1 << 32) - 1


def mad_inliers(
    voxel: npt.NDArray[np.int32],
    points: npt.NDArray[np.float32],
    multiplier: float,
    form: str,
    min_inliers: int,
) -> npt.NDArray[np.bool_]:
    """Which points (N,) stay.

    With r the distance to the mean of the voxel's points, m the median of r and MAD the median of
    |r - m|, `form` "deviation" (main text) keeps |r - m| <= multiplier MAD and "literal" (supplement)
    keeps r <= multiplier MAD. Voxels with fewer than `min_inliers` such points lose all of them. "off" keeps
    every point.

    Parameters
    ----------
    voxel : (N,) the voxel of each point, in any order, not negative.
    points : (N, 3) metres, relative to anything that is the same for a whole voxel.

    Radii and deviations are float32.
    """
    if not len(voxel) or form == "off":
        return np.ones(len(voxel), dtype=np.bool_)
    order, starts, counts = runs_by_voxel(voxel)
    ordered = points[order].astype(np.float64)
    group = np.repeat(np.arange(len(starts)), counts)
    # Added up one after the other, in the order given: other sums round differently.
    means = np.stack([np.bincount(group, axis) for axis in ordered.T], axis=1) / counts[:, None]
    x, y, z = (ordered - means[group]).T
    radii = np.sqrt(x * x + y * y + z * z).astype(np.float32)
    deviations = np.abs(radii - _medians(radii, group, starts, counts)[group])
    mad = _medians(deviations, group, starts, counts)
    inliers = (deviations if form == "deviation" else radii) <= np.float32(multiplier) * mad[group]
    inliers &= (np.add.reduceat(inliers, starts, dtype=np.int64) >= min_inliers)[group]
    result = np.empty(len(voxel), dtype=np.bool_)
    result[order] = inliers
    return result


def _medians(
    values: npt.NDArray[np.float32],
    group: npt.NDArray[np.int64],
    starts: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
) -> npt.NDArray[np.float32]:
    """Median (G,) of each run of values >= 0; of an even number the mean of the middle two, as numpy does."""
    # Floats that are not negative sort as their bits do.
    packed = np.sort((group << 32) | values.view(np.int32))
    ranked = (packed & _LOW).astype(np.int32).view(np.float32)
    return (ranked[starts + (counts - 1) // 2] + ranked[starts + counts // 2]) / np.float32(2)
