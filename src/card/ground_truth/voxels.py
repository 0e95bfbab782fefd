"""The regular grid of cubic voxels in world and its int64 keys (paper, supplement A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.geometry import Trajectory

#: Bits a key holds for each axis: 2 million voxels, 200 km at 10 cm.
AXIS_BITS = 21
#: How far beyond the trajectory the grid begins; no return of an automotive LiDAR lies further away.
MARGIN_M = 1000.0
#: Steps an edge is divided into, where points of a voxel are summed: 24 um at 10 cm, a quarter of LAZ's.
OFFSET_STEPS = 4096

Keys = npt.NDArray[np.int64]
Points = npt.NDArray[np.float64]


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels of edge `size` (m); `first` is the world index of the grid's voxel (0, 0, 0).

    Keys sort by x, then y, then z: the voxels of one vertical column are neighbours in a sorted list.
    """

    size: float
    first: tuple[int, int, int]

    @classmethod
    def around(cls, trajectory: Trajectory, size: float) -> VoxelGrid:
        """The grid that holds everything a LiDAR on `trajectory` can reach."""
        low = np.floor((trajectory.translation_m.min(axis=0) - MARGIN_M) / size)
        x, y, z = (int(v) for v in low)
        return cls(size, (x, y, z))

    @property
    def origin(self) -> Points:
        """(3,) corner of voxel (0, 0, 0) in world, metres: a multiple of the voxel size."""
        return np.array(self.first, dtype=np.float64) * self.size

    def indices(self, points: Points) -> npt.NDArray[np.int64]:
        """Voxel indices (N, 3), relative to the grid's first voxel, of world points (N, 3).

        The floor is taken in world coordinates, before anything is subtracted: index = floor(p / size).

        Raises
        ------
        CardError
            If a point lies outside the grid.
        """
        indices = np.floor(points / self.size).astype(np.int64) - np.array(self.first)
        if indices.size and (indices.min() < 0 or indices.max() >= 1 << AXIS_BITS):
            raise outside(points[((indices < 0) | (indices >= 1 << AXIS_BITS)).any(axis=1)][0])
        return indices

    def steps(self, points: Points) -> npt.NDArray[np.int64]:
        """Offsets (N, 3) of world points (N, 3) from their voxels' lower corners, in whole steps."""
        at = points / self.size
        return ((at - np.floor(at)) * OFFSET_STEPS).astype(np.int64)

    def keys(self, points: Points) -> Keys:
        """Keys (N,) of world points (N, 3)."""
        return pack(self.indices(points))

    def corners(self, keys: Keys) -> Points:
        """Lower corners (N, 3) in world, metres, of keys (N,)."""
        return (unpack(keys) + np.array(self.first)) * self.size


def outside(point: Points) -> CardError:
    """The error for a point (3,) that no voxel of a grid holds."""
    return CardError(
        "point outside the voxel grid",
        found=" ".join(f"{c:.0f}" for c in point) + " m",
        wanted=f"within {MARGIN_M:.0f} m of the trajectory",
    )


def pack(indices: npt.NDArray[np.int64]) -> Keys:
    """Keys (N,) of indices (N, 3), each in [0, 2^21)."""
    return (indices[:, 0] << 2 * AXIS_BITS) | (indices[:, 1] << AXIS_BITS) | indices[:, 2]


def unpack(keys: Keys) -> npt.NDArray[np.int64]:
    """Indices (N, 3) of keys (N,)."""
    mask = (1 << AXIS_BITS) - 1
    return np.stack([keys >> 2 * AXIS_BITS, (keys >> AXIS_BITS) & mask, keys & mask], axis=1)


def find(sorted_keys: Keys, keys: Keys) -> npt.NDArray[np.int64]:
    """Position of each key (N,) in an increasing list, -1 where it is not in it."""
    if not len(sorted_keys):
        return np.full(len(keys), -1, dtype=np.int64)
    at = np.minimum(np.searchsorted(sorted_keys, keys), len(sorted_keys) - 1)
    return np.where(sorted_keys[at] == keys, at, -1)
