"""An upper limit on the points of a voxel, for drives whose full density is not worth its price."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from card.ground_truth.reference.runs import runs_by_voxel


def thin(voxel: npt.NDArray[np.int32], limit: int) -> npt.NDArray[np.bool_]:
    """Which points (N,) stay if no voxel may keep more than `limit`: evenly spaced in the order given.

    Parameters
    ----------
    voxel : (N,) the voxel of each point, not negative. limit: 0 keeps all.
    """
    keep = np.ones(len(voxel), dtype=np.bool_)
    if not limit or not len(voxel):
        return keep
    order, starts, counts = runs_by_voxel(voxel)
    rank = np.arange(len(order)) - np.repeat(starts, counts)
    share = np.minimum(limit, counts)[np.repeat(np.arange(len(starts)), counts)]
    total = np.repeat(counts, counts)
    # Point k of n stays where floor(k limit / n) steps up: exactly `limit` times.
    keep[order] = (rank * share) // total != ((rank - 1) * share) // total
    return keep
