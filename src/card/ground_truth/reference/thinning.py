"""Upper limits on the points of a voxel."""

from __future__ import annotations

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


def pixel_limit(
    depth: npt.NDArray[np.float64], size: float, focal_px: float, pixels_per_point: float
) -> npt.NDArray[np.int64]:
    """Most points (V,) of voxels of edge `size` at `depth` (V,), metres: one for so many pixels, or one.

    A voxel covers some (f s / z)^2 pixels. Of more points than can be told apart in the image, hidden-point
    removal keeps the nearest, which noise alone decides.
    """
    edge = focal_px * size / depth
    return np.maximum((edge * edge / pixels_per_point).astype(np.int64), 1)
