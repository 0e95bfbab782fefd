"""Dynamic pruning by votes that are conditioned on visibility: a stated deviation from supplement C.

A nearest neighbour in one sparse sweep is further away than tau_flow for nearly half of a static road. So a
residual counts only where the sweep says something about the voxel: it hit it, or saw through it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.rays import Passes, SweepRays, pose_times
from card.ground_truth.surface import Surface, local_planes
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import find, pack, unpack

Index = npt.NDArray[np.int64]

#: Edge of the blocks, in voxels, by which voxels near a sweep are found.
_BLOCK = 64


@dataclass(frozen=True)
class Votes:
    """Votes of C voxels, at most one a sweep: hits, passes beside a return of the same sweep, moved."""

    hits: npt.NDArray[np.int32]
    beside: npt.NDArray[np.int32]
    moved: npt.NDArray[np.int32]

    @property
    def comparisons(self) -> npt.NDArray[np.int32]:
        """(C,) sweeps that said something about the voxel: c_v."""
        return self.hits + self.beside + self.moved


def evidence_sweeps(drive: Drive, baseline: float, step: int) -> list[int]:
    """Of each LiDAR the bursts that lie `baseline` (m) or more from the last one taken; every `step`-th."""
    chosen: list[int] = []
    for front in (True, False):
        taken: list[int] = []
        for i in drive.of(front):
            if not taken or np.linalg.norm(drive.origins[i] - drive.origins[taken[-1]]) >= baseline:
                taken.append(int(i))
        chosen += taken[::step]
    return sorted(chosen)


def visibility_votes(
    drive: Drive, sweeps: Iterable[int], voxels: VoxelMap, chosen: Index, settings: Mapping[str, Any]
) -> Votes:
    """Compare each evidence sweep with each chosen voxel (positions (C,) in the map) within range.

    With c the centroid of a voxel and n its normal, a sweep votes
    - *hit* if one of its returns lies in the voxel;
    - *beside* if a ray passes within `pass_lateral_m` of c and another return of the sweep lies in the cube
      of 2 `near_voxels` + 1 voxels round it;
    - *moved* if such a ray has no return near, its return q lies `moved_gap_m` or more behind c and, where
      the voxel is planar, |n (q - c)| > `flow_residual_m` and |n d| > `planar_min_incidence`;
    and otherwise nothing.
    """
    keys = voxels.keys[chosen]
    centroids = voxels.grid.corners(keys) + voxels.centroids[chosen]
    surface = local_planes(voxels, chosen, settings)
    blocks = _Blocks(keys)
    votes = Votes(*(np.zeros(len(chosen), dtype=np.int32) for _ in range(3)))
    for i in sweeps:
        sweep = drive.sweep(i)
        if not len(sweep.points):
            continue
        occupied = np.unique(voxels.grid.keys(sweep.points))
        hit = find(keys, occupied)
        hit = hit[hit >= 0]
        votes.hits[hit] += 1
        times = pose_times(int(drive.start_ns[i]), int(drive.end_ns[i]))
        rays = SweepRays(sweep.points, sweep.time_ns, sweep.ring, times, drive.poses(i, times))
        place = voxels.grid.indices(drive.origins[i : i + 1])[0]
        local = blocks.within(place, settings["pass_max_range_m"] / voxels.grid.size)
        local = local[~np.isin(local, hit)]
        passes = rays.passing(
            centroids[local],
            settings["pass_lateral_m"],
            settings["pass_min_range_m"],
            settings["pass_max_range_m"],
            settings["pass_beyond_m"],
        )
        passed = np.unique(passes.place)
        near = _have_return_near(keys[local[passed]], occupied, settings["near_voxels"])
        votes.beside[local[passed[near]]] += 1
        contradicts = _contradicts(passes, local, surface, settings)
        moved = np.setdiff1d(passes.place[contradicts], passed[near])
        votes.moved[local[moved]] += 1
    return votes


def dynamic_by_visibility(
    votes: Votes, quotas_met: npt.NDArray[np.bool_], settings: Mapping[str, Any]
) -> npt.NDArray[np.bool_]:
    """Which voxels (C,) are dynamic: at least V_dyn moved votes, and a share of the comparisons.

    The quotas (C,) of supplement B say how much contradiction a voxel may take.
    """
    share = votes.moved / np.maximum(votes.comparisons, 1)
    limit = np.where(
        quotas_met, settings["moved_fraction_quotas_met"], settings["moved_fraction_quotas_missed"]
    )
    return (votes.moved >= settings["moved_votes"]) & (share >= limit)


def _contradicts(
    passes: Passes, local: Index, surface: Surface, settings: Mapping[str, Any]
) -> npt.NDArray[np.bool_]:
    """Passes (K,) that a surface at the place would have stopped, and clearly so."""
    normals, planar = surface.normals[local[passes.place]], surface.planar[local[passes.place]]
    incidence = np.abs(np.einsum("ki,ki->k", normals, passes.direction))
    offset = np.abs(np.einsum("ki,ki->k", normals, passes.gap))
    clear = (offset > settings["flow_residual_m"]) & (incidence > settings["planar_min_incidence"])
    return (passes.beyond >= settings["moved_gap_m"]) & (~planar | clear)


def _have_return_near(keys: Index, occupied: Index, radius: int) -> npt.NDArray[np.bool_]:
    """Whether a key of `occupied` lies in the cube of 2 radius + 1 voxels round each of `keys` (K,)."""
    from scipy.spatial import cKDTree

    if not len(keys):
        return np.zeros(0, dtype=np.bool_)
    tree = cKDTree(unpack(occupied))
    distance, _ = tree.query(unpack(keys), p=np.inf, distance_upper_bound=radius + 0.5)
    return np.isfinite(distance)


class _Blocks:
    """Voxels by coarse block, so that a sweep does not look at the whole drive."""

    def __init__(self, keys: Index) -> None:
        block = pack(unpack(keys) // _BLOCK)
        self._order = np.argsort(block, kind="stable")
        self._keys, self._starts = np.unique(block[self._order], return_index=True)
        self._ends = np.r_[self._starts[1:], len(keys)]

    def within(self, index: Index, radius: float) -> Index:
        """Increasing positions of all voxels within `radius` voxels of a voxel index (3,), and some more."""
        centres = (unpack(self._keys) + 0.5) * _BLOCK
        away = np.maximum(np.abs(centres - index) - _BLOCK / 2 - 1, 0)
        near = np.flatnonzero((away**2).sum(axis=1) <= radius**2)
        parts = [self._order[self._starts[b] : self._ends[b]] for b in near]
        return np.sort(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)
