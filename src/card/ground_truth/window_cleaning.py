"""Which points of a voxel stay, compiled: cleaning by MAD, and how the inliers spread."""

from __future__ import annotations

from typing import Any

import numpy as np

from card.ground_truth.compiled import compiled
from card.ground_truth.window_rows import Rows


@compiled
def _median(values: Any, count: int) -> Any:
    """Median of the first values; of an even number the mean of the middle two. They are put in order."""
    if count <= 40:
        for i in range(1, count):
            value, j = values[i], i
            while j > 0 and values[j - 1] > value:
                values[j] = values[j - 1]
                j -= 1
            values[j] = value
    else:
        values[:count].sort()
    return (values[(count - 1) // 2] + values[count // 2]) / np.float32(2)


@compiled
def _add(offset: Any, sums: Any) -> None:
    """Add a point (3,) and its products, xx xy xz yy yz zz, to the sums (9,)."""
    x, y, z = np.float64(offset[0]), np.float64(offset[1]), np.float64(offset[2])
    sums[0] += x
    sums[1] += y
    sums[2] += z
    sums[3] += x * x
    sums[4] += x * y
    sums[5] += x * z
    sums[6] += y * y
    sums[7] += y * z
    sums[8] += z * z


@compiled
def _spread(sums: Any, count: int, mean: Any, spread: Any) -> None:
    """Mean (3,) and covariance (6,) of points from their sums (9,)."""
    at = 0
    for i in range(3):
        mean[i] = sums[i] / count
    for i in range(3):
        for j in range(i, 3):
            spread[at] = sums[3 + at] / count - mean[i] * mean[j]
            at += 1


@compiled
def clean(
    rows: Rows,
    near: Any,
    multiplier: float,
    literal: bool,
    off: bool,
    min_inliers: int,
    limit: int,
    place: Any,
    radius: Any,
    sorted_: Any,
) -> tuple[int, int]:
    """Clean the voxels listed whose points changed; see `reference.mad` and `reference.thinning`.

    place, radius, sorted_ : (M,) int64, float32, float32 memory, for as many points as a voxel holds.

    Returns
    -------
    Inliers in the voxels listed, and how many of them thinning keeps.
    """
    factor = np.float32(multiplier)
    sums = np.empty(9)
    inliers = thinned = 0
    for v in near:
        if rows.changed[v]:
            rows.changed[v] = False
            # The two rows in order of time.
            i, i_end = rows.head[2 * v], rows.tail[2 * v]
            j, j_end = rows.head[2 * v + 1], rows.tail[2 * v + 1]
            count = 0
            x = y = z = 0.0
            while i < i_end or j < j_end:
                if j == j_end or (i < i_end and rows.burst[i] < rows.burst[j]):
                    at = i
                    i += 1
                else:
                    at = j
                    j += 1
                place[count] = at
                count += 1
                x += rows.offset[at, 0]
                y += rows.offset[at, 1]
                z += rows.offset[at, 2]
            x, y, z = x / count, y / count, z / count
            for k in range(count):
                at = place[k]
                dx, dy, dz = rows.offset[at, 0] - x, rows.offset[at, 1] - y, rows.offset[at, 2] - z
                radius[k] = sorted_[k] = np.float32(np.sqrt(dx * dx + dy * dy + dz * dz))
            median = _median(sorted_, count)
            for k in range(count):
                sorted_[k] = abs(radius[k] - median)
                if not literal:
                    radius[k] = sorted_[k]
            largest = np.float32(np.inf) if off else factor * _median(sorted_, count)
            total = 0
            for k in range(count):
                total += radius[k] <= largest
            if total < min_inliers and not off:
                total = 0
            share = min(limit, total) if limit > 0 else total
            # Point k of n inliers stays where floor(k share / n) steps up: k share mod n < share.
            rest = 0
            sums[:] = 0.0
            for k in range(count):
                at = place[k]
                inlier = total > 0 and radius[k] <= largest
                rows.kept[at] = inlier and rest < share
                if inlier:
                    rest += share
                    if rest >= total:
                        rest -= total
                    _add(rows.offset[at], sums)
            _spread(sums, max(total, 1), rows.mean[v], rows.spread[v])
            rows.clean[v], rows.left[v] = total, share
        inliers += rows.clean[v]
        thinned += rows.left[v]
    return inliers, thinned
