"""Local planes of the voxel map in plain numpy; see `ground_truth.planes`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import AXIS_BITS

#: Voxels worked on at once.
CHUNK = 200_000


@dataclass(frozen=True)
class Surface:
    """normals: (V, 3) float64 unit vectors. planar: (V,) bool, whether the normal means anything."""

    normals: npt.NDArray[np.float64]
    planar: npt.NDArray[np.bool_]


def local_planes(voxels: VoxelMap, chosen: npt.NDArray[np.int64], settings: Mapping[str, Any]) -> Surface:
    """The plane through the means of the voxels round each chosen one (positions (C,) in the map).

    `ground_truth.planes.find_planes` says what makes a voxel planar.
    """
    parts = [
        _planes(voxels, chosen[at : at + CHUNK], settings) for at in range(0, max(len(chosen), 1), CHUNK)
    ]
    return Surface(np.concatenate([p.normals for p in parts]), np.concatenate([p.planar for p in parts]))


def _planes(voxels: VoxelMap, chosen: npt.NDArray[np.int64], settings: Mapping[str, Any]) -> Surface:
    count, mean, second = _moments(voxels, chosen, settings["near_voxels"])
    mean /= count[:, None]
    scatter = second / count[:, None, None] - mean[:, :, None] * mean[:, None, :]
    variance, axes = np.linalg.eigh(scatter)
    deviation = np.sqrt(np.maximum(variance, 0))
    planar = (
        (count >= settings["planar_min_voxels"])
        & (deviation[:, 0] < settings["planar_max_thickness_m"])
        & (deviation[:, 1] > settings["planar_min_ratio"] * deviation[:, 0])
    )
    return Surface(axes[:, :, 0], planar)


def _moments(
    voxels: VoxelMap, chosen: npt.NDArray[np.int64], radius: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Count (C,), sum (C, 3) and sum of squares (C, 3, 3) of the neighbours' means, from the own corner."""
    keys = voxels.keys
    size = voxels.grid.size
    sums = np.zeros((10, len(chosen)))
    span = range(-radius, radius + 1)
    for dx, dy in ((dx, dy) for dx in span for dy in span):
        # A vertical run of voxels is one run of keys.
        low = keys[chosen] + (dx << 2 * AXIS_BITS) + (dy << AXIS_BITS) - radius
        first = np.searchsorted(keys, low)
        for step in range(2 * radius + 1):
            at = np.minimum(first + step, len(keys) - 1)
            dz = keys[at] - low
            here = np.flatnonzero((first + step < len(keys)) & (dz <= 2 * radius))
            neighbour = voxels.centroids[at[here]].astype(np.float64)
            x = neighbour[:, 0] + dx * size
            y = neighbour[:, 1] + dy * size
            z = neighbour[:, 2] + (dz[here] - radius) * size
            for k, term in enumerate((1.0, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)):
                sums[k, here] += term
    second = sums[[4, 5, 6, 5, 7, 8, 6, 8, 9]].T.reshape(-1, 3, 3)
    return sums[0], sums[1:4].T.copy(), second
