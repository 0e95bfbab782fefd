"""The static points of the bursts round a frame, kept in memory while frames go by."""

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


class StaticWindow:
    """Holds the static points of the bursts of the last request only."""

    def __init__(self, drive: Drive, static: StaticSet) -> None:
        self._drive, self._static = drive, static
        self._bursts: dict[int, tuple[npt.NDArray[np.int32], npt.NDArray[np.float32], int]] = {}

    def cloud(self, bursts: npt.NDArray[np.int64]) -> StaticCloud:
        """The static points of bursts (B,), given by their ordinals in increasing order."""
        self._bursts = {int(i): self._bursts.get(int(i)) or self._load(int(i)) for i in bursts}
        parts = list(self._bursts.values())
        sizes = [len(voxel) for voxel, _, _ in parts]
        return StaticCloud(
            voxel=np.concatenate([np.empty(0, dtype=np.int32), *(v for v, _, _ in parts)]),
            offset=np.concatenate([np.empty((0, 3), dtype=np.float32), *(o for _, o, _ in parts)]),
            burst=np.repeat(bursts.astype(np.int32), sizes),
            front=np.repeat(self._drive.front[bursts], sizes),
            total=sum(total for _, _, total in parts),
        )

    def _load(self, i: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32], int]:
        points = self._drive.sweep(i).points
        keys = self._static.grid.keys(points)
        voxel = find(self._static.keys, keys)
        inside = voxel >= 0
        offset = points[inside] - self._static.grid.corners(keys[inside])
        return voxel[inside].astype(np.int32), offset.astype(np.float32), len(points)


def seen_by(cloud: StaticCloud, voxels: int) -> npt.NDArray[np.int64]:
    """|S_v| (V,): how many LiDARs have a point of the cloud in each static voxel."""
    seen = np.zeros((2, voxels), dtype=np.int64)
    seen[0, cloud.voxel[cloud.front]] = 1
    seen[1, cloud.voxel[~cloud.front]] = 1
    return seen.sum(axis=0)
