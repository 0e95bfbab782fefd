"""Distinct viewpoints of voxels: the greedy spacing gate and the motion baseline (paper, supplement B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Views:
    """What the gate says of G voxels.

    count: (G,) int32 accepted viewpoints; a lower bound for a settled voxel.
    baseline: (G,) float64, metres, largest distance between two of them; likewise.
    settled: (G,) bool, nothing that comes later can change the voxel's quotas or their outcome.
    voxel, burst: (A,) the accepted viewpoints of the voxels that are not settled, in order.
    """

    count: npt.NDArray[np.int32]
    baseline: npt.NDArray[np.float64]
    settled: npt.NDArray[np.bool_]
    voxel: npt.NDArray[np.int64]
    burst: npt.NDArray[np.int64]


def distinct_views(
    voxel: npt.NDArray[np.int64],
    burst: npt.NDArray[np.int64],
    origins: npt.NDArray[np.float64],
    voxels: int,
    spacing: float,
    enough: int,
    far: float,
) -> Views:
    """Accept, in order, each viewpoint that is at least `spacing` away from all accepted before it.

    Parameters
    ----------
    voxel, burst : (N,) sorted by voxel in [0, voxels), then by burst: who was seen from where.
    origins : (B, 3) sensor origin of each burst in world, metres.
    enough, far : a voxel is settled at `enough` viewpoints and a baseline (m) of `far`: both only grow,
        and quotas are then at their minimum. Stopping there leaves every decision exact.
    """
    count = np.zeros(voxels, dtype=np.int32)
    baseline = np.zeros(voxels)
    accepted: list[npt.NDArray[np.int64]] = []
    alive = np.arange(len(voxel))
    # Every round accepts one viewpoint in each voxel that still has candidates.
    while len(alive):
        group = voxel[alive]
        head = alive[np.r_[True, group[1:] != group[:-1]]]
        chosen = np.full(voxels, -1, dtype=np.int64)
        chosen[voxel[head]] = burst[head]
        for earlier in accepted:
            apart = np.linalg.norm(origins[burst[head]] - origins[earlier[voxel[head]]], axis=1)
            baseline[voxel[head]] = np.maximum(baseline[voxel[head]], apart)
        accepted.append(chosen)
        count[voxel[head]] += 1
        apart = np.linalg.norm(origins[burst[alive]] - origins[chosen[group]], axis=1)
        open_ = ~_settled(count, baseline, enough, far)[group]
        alive = alive[open_ & (apart >= spacing) & (burst[alive] != chosen[group])]
    settled = _settled(count, baseline, enough, far)
    kept = np.stack(accepted, axis=1) if accepted else np.empty((voxels, 0), dtype=np.int64)
    keep_voxel, keep_round = np.nonzero((kept >= 0) & ~settled[:, None])
    return Views(count, baseline, settled, keep_voxel, kept[keep_voxel, keep_round])


def _settled(
    count: npt.NDArray[np.int32], baseline: npt.NDArray[np.float64], enough: int, far: float
) -> npt.NDArray[np.bool_]:
    return (count >= enough) & (baseline >= far)
