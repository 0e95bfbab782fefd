"""Registers a sweep to the map by voxelized GICP before it votes: a remedy for errors of its pose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.geometry import apply

Floats = npt.NDArray[np.float64]

#: Neighbours from which small_gicp takes a point's covariance.
_NEIGHBOURS = 10


class MapTarget:
    """What sweeps near a place are registered to: the centroids (N, 3) of the map's voxels there, world."""

    def __init__(self, centroids: Floats, origin: Floats, settings: Mapping[str, Any]) -> None:
        import small_gicp

        # small_gicp drops points too far from zero.
        self._origin = origin.copy()
        self._downsampling = settings["flow_downsampling_m"]
        self._reach = settings["flow_max_correspondence_m"]
        self._voxels = small_gicp.GaussianVoxelMap(settings["flow_voxel_resolution_m"])
        self._voxels.insert(self._prepared(centroids))

    def register(self, points: Floats, origins: Floats) -> tuple[Floats, Floats]:
        """Returns and origins (N, 3) of a sweep's rays, moved rigidly onto the map; unmoved if that fails."""
        import small_gicp

        result = small_gicp.align(
            self._voxels,
            self._prepared(points),
            max_correspondence_distance=self._reach,
            num_threads=1,
        )
        if not result.converged:
            return points, origins
        moved = result.T_target_source
        return self._apply(moved, points), self._apply(moved, origins)

    def _prepared(self, points: Floats) -> Any:
        import small_gicp

        # One thread: sums over threads do not repeat.
        cloud, _ = small_gicp.preprocess_points(
            points - self._origin,
            downsampling_resolution=self._downsampling,
            num_neighbors=_NEIGHBOURS,
            num_threads=1,
        )
        return cloud

    def _apply(self, moved: Floats, points: Floats) -> Floats:
        return apply(moved, points - self._origin) + self._origin
