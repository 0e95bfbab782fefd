"""Upper limits on the points of a voxel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.reference.runs import runs_by_voxel


def thin(voxel: npt.NDArray[np.int32], limit: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which points (N,) stay if no voxel may keep more than its limit: evenly spaced in the order given.

    Parameters
    ----------
    voxel : (N,) the voxel of each point, not negative. limit : (V,) of each voxel, at least 1.
    """
    keep = np.ones(len(voxel), dtype=np.bool_)
    if not len(voxel):
        return keep
    order, starts, counts = runs_by_voxel(voxel)
    rank = np.arange(len(order)) - np.repeat(starts, counts)
    share = np.minimum(limit[voxel[order[starts]]], counts)[np.repeat(np.arange(len(starts)), counts)]
    total = np.repeat(counts, counts)
    # Point k of n stays where floor(k limit / n) steps up: exactly `limit` times.
    keep[order] = (rank * share) // total != ((rank - 1) * share) // total
    return keep


def pixels_covered(
    voxel: npt.NDArray[np.int32],
    offset: npt.NDArray[np.float32],
    corner: npt.NDArray[np.float64],
    rotation: npt.NDArray[np.float64],
    focal_px: tuple[float, float],
    nearest: float,
) -> npt.NDArray[np.float64]:
    """How many pixels (V,) the points of each voxel cover: the area of the patch that spreads as they do.

    With C the covariance of the points of a voxel on the image, to first order, that is 12 sqrt(det C): an
    evenly filled parallelogram of area A has det C = (A / 12)^2. A surface seen at a grazing angle covers
    little, and noise along the camera's rays nothing.

    Parameters
    ----------
    voxel : (N,) the voxel of each point. offset : (N, 3) metres from its corner.
    corner : (V, 3) camera_left, metres. rotation : (3, 3) camera_from_world. focal_px : of x and y.
    nearest : smallest depth, metres.
    """
    points = offset.astype(np.float64).T
    counts = np.maximum(np.bincount(voxel, minlength=len(corner)), 1)

    def mean(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        # Added up one after the other, in the order given: other sums round differently.
        return np.bincount(voxel, values, len(corner)) / counts

    centre = [mean(axis) for axis in points]
    spread = [[mean(points[i] * points[j]) - centre[i] * centre[j] for j in range(3)] for i in range(3)]
    place = [
        corner[:, i] + (row[0] * centre[0] + row[1] * centre[1] + row[2] * centre[2])
        for i, row in enumerate(rotation)
    ]
    z = np.maximum(place[2], nearest)
    u, w = (
        [(rotation[i, k] - place[i] / z * rotation[2, k]) * (focal_px[i] / z) for k in range(3)]
        for i in range(2)
    )

    def form(a: Sequence[npt.NDArray[np.float64]], b: Sequence[npt.NDArray[np.float64]]) -> Any:
        return (
            a[0] * b[0] * spread[0][0]
            + a[1] * b[1] * spread[1][1]
            + a[2] * b[2] * spread[2][2]
            + (a[0] * b[1] + a[1] * b[0]) * spread[0][1]
            + (a[0] * b[2] + a[2] * b[0]) * spread[0][2]
            + (a[1] * b[2] + a[2] * b[1]) * spread[1][2]
        )

    across = form(u, w)
    area: npt.NDArray[np.float64] = 12 * np.sqrt(np.maximum(form(u, u) * form(w, w) - across * across, 0))
    return area
