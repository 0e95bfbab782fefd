"""Outlier cleaning by the median absolute deviation in each voxel (paper, supplement D and main text)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


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
    keeps r <= multiplier MAD. Voxels with fewer than `min_inliers` such points lose all of them.

    Parameters
    ----------
    voxel : (N,) the voxel of each point, in any order.
    points : (N, 3) metres, relative to anything that is the same for a whole voxel.
    """
    if not len(voxel):
        return np.zeros(0, dtype=np.bool_)
    order = np.argsort(voxel, kind="stable")
    groups = voxel[order]
    starts = np.flatnonzero(np.r_[True, groups[1:] != groups[:-1]])
    counts = np.diff(np.r_[starts, len(groups)])
    ordered = points[order].astype(np.float64)
    means = np.add.reduceat(ordered, starts) / counts[:, None]
    group = np.repeat(np.arange(len(starts)), counts)
    radii = np.linalg.norm(ordered - means[group], axis=1)
    deviations = np.abs(radii - _medians(radii, group, starts, counts)[group])
    mad = _medians(deviations, group, starts, counts)
    inliers = (deviations if form == "deviation" else radii) <= multiplier * mad[group]
    inliers &= (np.add.reduceat(inliers, starts, dtype=np.int64) >= min_inliers)[group]
    result = np.empty(len(voxel), dtype=np.bool_)
    result[order] = inliers
    return result


def _medians(
    values: npt.NDArray[np.float64],
    group: npt.NDArray[np.int64],
    starts: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
) -> npt.NDArray[np.float64]:
    """Median (G,) of each run of values; of an even number the mean of the middle two, as numpy does."""
    ranked = values[np.lexsort((values, group))]
    return (ranked[starts + (counts - 1) // 2] + ranked[starts + counts // 2]) / 2
