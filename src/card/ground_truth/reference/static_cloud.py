"""The static points of the bursts round a frame, read burst by burst."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from card.ground_truth.static_set import StaticSet
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxels import find


@dataclass(frozen=True)
class StaticCloud:
    """N points of the selected bursts that lie in static voxels.

    voxel: (N,) int32 position in the static set. offset: (N, 3) float32, metres from the voxel's corner.
    burst: (N,) int32. front: (N,) bool. total: points of the bursts, static or not.
    """

    voxel: npt.NDArray[np.int32]
    offset: npt.NDArray[np.float32]
    burst: npt.NDArray[np.int32]
    front: npt.NDArray[np.bool_]
    total: int


def static_cloud(drive: Drive, static: StaticSet, bursts: npt.NDArray[np.int64]) -> StaticCloud:
    """The static points of bursts (B,), given by their ordinals in increasing order."""
    voxels, offsets, sizes = [np.empty(0, dtype=np.int32)], [np.empty((0, 3), dtype=np.float32)], []
    total = 0
    for i in bursts:
        points = drive.sweep(int(i)).points
        keys = static.grid.keys(points)
        voxel = find(static.keys, keys)
        inside = voxel >= 0
        voxels.append(voxel[inside].astype(np.int32))
        offsets.append((points[inside] - static.grid.corners(keys[inside])).astype(np.float32))
        sizes.append(len(voxels[-1]))
        total += len(points)
    return StaticCloud(
        voxel=np.concatenate(voxels),
        offset=np.concatenate(offsets),
        burst=np.repeat(bursts.astype(np.int32), sizes),
        front=np.repeat(drive.front[bursts], sizes),
        total=total,
    )


def seen_by(cloud: StaticCloud, voxels: int) -> npt.NDArray[np.int64]:
    """|S_v| (V,): how many LiDARs have a point of the cloud in each static voxel."""
    seen = np.zeros((2, voxels), dtype=np.int64)
    seen[0, cloud.voxel[cloud.front]] = 1
    seen[1, cloud.voxel[~cloud.front]] = 1
    return seen.sum(axis=0)
