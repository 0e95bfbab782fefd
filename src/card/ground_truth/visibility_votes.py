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

from card.ground_truth.block_grid import block_grid
from card.ground_truth.pass_votes import PassRule, Region, sweep_votes
from card.ground_truth.planes import PlaneRule, find_planes
from card.ground_truth.rays import ray_origins
from card.ground_truth.sweep_registration import MapTarget
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import pack, unpack

Index = npt.NDArray[np.int64]

#: Edge of the tiles, in voxels, by which voxels near a sweep are found.
_TILE = 64
#: How far a sensor may go before the voxels round it are gathered anew, m.
_REACH_M = 20.0


@dataclass(frozen=True)
class Votes:
    """Votes of C voxels, at most one a sweep: hits, passes beside a return of the same sweep, moved.

    elsewhen: those of the latter two that are of a time at which nothing hit the voxel; moved_elsewhen: of
    the last.
    """

    hits: npt.NDArray[np.int32]
    beside: npt.NDArray[np.int32]
    moved: npt.NDArray[np.int32]
    elsewhen: npt.NDArray[np.int32]
    moved_elsewhen: npt.NDArray[np.int32]

    @property
    def comparisons(self) -> npt.NDArray[np.int32]:
        """(C,) sweeps that said something about the voxel: c_v."""
        return self.hits + self.beside + self.moved

    @property
    def moved_share(self) -> npt.NDArray[np.float64]:
        """Share of the comparisons (C,) that say moved; 0 without any."""
        share: npt.NDArray[np.float64] = self.moved / np.maximum(self.comparisons, 1)
        return share


def evidence_sweeps(drive: Drive, settings: Mapping[str, Any]) -> list[int]:
    """Of each LiDAR the bursts `flow_baseline_m` or `evidence_gap_s` after the last taken; every `step`-th.

    Where the car stands nothing but time tells apart what moves.
    """
    baseline, gap_ns = settings["flow_baseline_m"], settings["evidence_gap_s"] * 1e9
    chosen: list[int] = []
    for front in (True, False):
        taken: list[int] = []
        for i in drive.of(front):
            if (
                not taken
                or drive.end_ns[i] - drive.end_ns[taken[-1]] >= gap_ns
                or np.linalg.norm(drive.origins[i] - drive.origins[taken[-1]]) >= baseline
            ):
                taken.append(int(i))
        chosen += taken[:: settings["evidence_step"]]
    return sorted(chosen)


def visibility_votes(
    drive: Drive, sweeps: Iterable[int], voxels: VoxelMap, chosen: Index, settings: Mapping[str, Any]
) -> Votes:
    """Compare each evidence sweep with each chosen voxel (increasing positions (C,) in the map) in range.

    With c the centroid of a voxel, n its normal and d the direction of a ray that returns at q, the ray
    *passes* the voxel if it crosses it and its point nearest to c lies within `pass_lateral_m` of c, between
    `pass_min_range_m` and `pass_max_range_m` from the sensor and `pass_beyond_m` or more before q. A sweep
    votes
    - *hit* if one of its returns, no further away than `pass_max_range_m`, lies in the voxel;
    - *beside* if a ray passes and another return of the sweep lies in the cube of 2 `near_voxels` + 1 voxels
      round the voxel;
    - *moved* if no return is near, a ray passes `moved_gap_m` or more before q and, where the voxel is planar
      (`planes.find_planes`), |n (q - c)| > `flow_residual_m` and |n d| > `planar_min_incidence`;
    and otherwise nothing. Of the votes *beside* and *moved* those count as *elsewhen* that lie more than
    `support_margin_s` before the first or after the last return that any sweep of the drive has of the voxel.
    With `register_sweeps` a sweep is first registered to the map, which only its own
    votes see. `reference.visibility_votes` is the same in plain numpy.
    """
    rules = _rules(settings)
    votes = np.zeros((len(chosen), 5), dtype=np.int32)
    margin_ns = int(settings["support_margin_s"] * 1e9)
    tiles = _Tiles(voxels)
    region, target, centre = None, None, np.full(3, np.inf)
    for i in sweeps:
        sweep = drive.sweep(i)
        if not len(sweep.points):
            continue
        origins = ray_origins(drive, i, sweep)
        if region is None or np.linalg.norm(origins - centre, axis=1).max() > _REACH_M:
            centre = drive.origins[i]
            near = tiles.within(voxels.grid.indices(centre[None])[0], _radius(voxels, rules))
            first, last = hit_times(drive, voxels, near)
            region = _region(voxels, chosen, near, centre, rules, (first - margin_ns, last + margin_ns))
            if settings["register_sweeps"]:
                centroids = voxels.grid.corners(voxels.keys[near]) + voxels.centroids[near]
                target = MapTarget(centroids, centre, settings)
        points = sweep.points
        if target is not None:
            points, origins = target.register(points, origins)
        t_ns = int(drive.end_ns[i])
        sweep_votes(i, t_ns, points, origins, voxels.grid.size, region, rules[0], votes)
    return Votes(*votes.T)


def hit_times(drive: Drive, voxels: VoxelMap, at: Index) -> tuple[Index, Index]:
    """Ends (N,), ns, of the first and the last burst with a point in the voxels at positions (N,)."""
    first = voxels.first[at].astype(np.int64)
    last = np.minimum(first + voxels.span[at], len(drive.end_ns) - 1)
    return drive.end_ns[first], drive.end_ns[last]


def _rules(settings: Mapping[str, Any]) -> tuple[PassRule, PlaneRule]:
    passes = PassRule(
        nearest_m=float(settings["pass_min_range_m"]),
        furthest_m=float(settings["pass_max_range_m"]),
        lateral_m=float(settings["pass_lateral_m"]),
        beyond_m=float(settings["pass_beyond_m"]),
        near_voxels=settings["near_voxels"],
        gap_m=float(settings["moved_gap_m"]),
        residual_m=float(settings["flow_residual_m"]),
        incidence=float(settings["planar_min_incidence"]),
    )
    planes = PlaneRule(
        near_voxels=settings["near_voxels"],
        min_voxels=settings["planar_min_voxels"],
        max_thickness_m=float(settings["planar_max_thickness_m"]),
        min_ratio=float(settings["planar_min_ratio"]),
    )
    return passes, planes


def _radius(voxels: VoxelMap, rules: tuple[PassRule, PlaneRule]) -> float:
    """How far, in voxels, what sweeps within `_REACH_M` of a place speak of may lie, with its neighbours."""
    reach = _REACH_M + rules[0].furthest_m
    return reach / voxels.grid.size + 8 + 2 * rules[1].near_voxels


def _region(
    voxels: VoxelMap,
    chosen: Index,
    near: Index,
    centre: npt.NDArray[np.float64],
    rules: tuple[PassRule, PlaneRule],
    hit: tuple[Index, Index],
) -> Region:
    """The voxels at positions `near` in the map, for sweeps within `_REACH_M` of `centre`."""
    size, planes = voxels.grid.size, rules[1]
    index = voxels.grid.indices(centre[None])
    reach = int(np.ceil(_REACH_M / size)) + 8
    grid = block_grid(voxels.keys[near], np.concatenate([index - reach, index + reach]))
    at = np.minimum(np.searchsorted(chosen, near), max(len(chosen) - 1, 0))
    wanted = chosen[at] == near if len(chosen) else np.zeros(len(near), dtype=np.bool_)
    offsets = voxels.centroids[near]
    cells = unpack(voxels.keys[near]) - grid.low
    normals = np.zeros((len(near), 3), dtype=np.float32)
    planar = np.zeros(len(near), dtype=np.int8)
    find_planes(grid, cells, offsets, size, wanted, planes, normals, planar)
    return Region(
        grid=grid,
        world=grid.low + np.array(voxels.grid.first),
        offsets=offsets,
        chosen=np.where(wanted, at, -1),
        normals=normals,
        planar=planar,
        begin=hit[0],
        end=hit[1],
        returns=np.zeros_like(grid.bits),
        known=np.full(len(near), -1, dtype=np.int64),
    )


class _Tiles:
    """Voxels by coarse tile, so that a sweep does not look at the whole drive."""

    def __init__(self, voxels: VoxelMap) -> None:
        tile = pack(unpack(voxels.keys) // _TILE)
        self._order = np.argsort(tile, kind="stable")
        self._keys, self._starts = np.unique(tile[self._order], return_index=True)
        self._ends = np.r_[self._starts[1:], len(tile)]

    def within(self, index: Index, radius: float) -> Index:
        """Positions of all voxels within `radius` voxels of a voxel index (3,), and some more."""
        centres = (unpack(self._keys) + 0.5) * _TILE
        away = np.maximum(np.abs(centres - index) - _TILE / 2 - 1, 0)
        near = np.flatnonzero((away**2).sum(axis=1) <= radius**2)
        parts = [self._order[self._starts[t] : self._ends[t]] for t in near]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])
