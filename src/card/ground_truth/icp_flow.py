"""Dynamic pruning with ICP flow: the paper's supplement C word for word, or against several sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.geometry import apply
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import find


@dataclass(frozen=True)
class FlowVotes:
    """Votes of V voxels, at most one a pair of sweeps: moved m_v, comparisons c_v."""

    moved: npt.NDArray[np.int32]
    comparisons: npt.NDArray[np.int32]


def scan_pairs(drive: Drive, baseline: float, gap_s: float) -> list[tuple[int, int]]:
    """Each burst with the first later one of the same LiDAR that is `baseline` (m) and `gap_s` (s) away."""
    pairs = []
    for front in (True, False):
        bursts = drive.of(front)
        for at, i in enumerate(bursts):
            later = bursts[at + 1 :]
            apart = np.linalg.norm(drive.origins[later] - drive.origins[i], axis=1) >= baseline
            waited = drive.end_ns[later] - drive.end_ns[i] >= gap_s * 1e9
            fits = np.flatnonzero(apart & waited)
            if len(fits):
                pairs.append((int(i), int(later[fits[0]])))
    return pairs


def flow_votes(drive: Drive, voxels: VoxelMap, settings: Mapping[str, Any]) -> FlowVotes:
    """Votes of all voxels of the map from all pairs of sweeps.

    With `flow_method` "submap" the residual of a pair (i, j) is the distance to the `flow_submap_sweeps`
    sweeps of the LiDAR round j, which one registration of j moves together.
    """
    around = settings["flow_submap_sweeps"] // 2 if settings["flow_method"] == "submap" else 0
    votes = FlowVotes(*(np.zeros(len(voxels.keys), dtype=np.int32) for _ in range(2)))
    for i, j in scan_pairs(drive, settings["flow_baseline_m"], settings["flow_min_gap_s"]):
        reference, other = drive.sweep(i).points, drive.sweep(j).points
        if not len(reference) or not len(other):
            continue
        of_sensor = drive.of(bool(drive.front[j]))
        at = int(np.searchsorted(of_sensor, j))
        near = [int(k) for k in of_sensor[max(at - around, 0) : at + around + 1] if k not in (i, j)]
        more = np.concatenate([np.empty((0, 3)), *(drive.sweep(k).points for k in near)])
        residuals = flow_residuals(reference, other, drive.origins[i], settings, more)
        voxel = find(voxels.keys, voxels.grid.keys(reference))
        votes.comparisons[np.unique(voxel)] += 1
        votes.moved[np.unique(voxel[residuals > settings["flow_residual_m"]])] += 1
    return votes


def flow_residuals(
    reference: npt.NDArray[np.float64],
    other: npt.NDArray[np.float64],
    origin: npt.NDArray[np.float64],
    settings: Mapping[str, Any],
    more: npt.NDArray[np.float64] | None = None,
) -> npt.NDArray[np.float64]:
    """delta (N,), metres: distance of each reference point to the other sweep, registered by VGICP.

    Parameters
    ----------
    reference, other : (N, 3) and (M, 3) world, metres.
    origin : (3,) a point near both: small_gicp drops points too far from zero.
    more : (K, 3) points that move with the other sweep and count like its own.
    """
    import small_gicp
    from scipy.spatial import cKDTree

    target, source = reference - origin, other - origin
    # One thread: sums over threads do not repeat.
    result = small_gicp.align(
        target,
        source,
        registration_type="VGICP",
        voxel_resolution=settings["flow_voxel_resolution_m"],
        downsampling_resolution=settings["flow_downsampling_m"],
        max_correspondence_distance=settings["flow_max_correspondence_m"],
        num_threads=1,
    )
    # A registration that wanders off would contradict everything: the poses are then the better guess.
    target_from_source = result.T_target_source if result.converged else np.eye(4)
    moved = source if more is None else np.concatenate([source, more - origin])
    aligned = apply(target_from_source, moved)
    distances, _ = cKDTree(aligned).query(target)
    return np.asarray(distances, dtype=np.float64)


def dynamic_by_flow(votes: FlowVotes, settings: Mapping[str, Any]) -> npt.NDArray[np.bool_]:
    """Which voxels (V,) are dynamic: m_v >= V_dyn and m_v / c_v >= eta_dyn."""
    share = votes.moved / np.maximum(votes.comparisons, 1)
    enough: npt.NDArray[np.bool_] = votes.moved >= settings["moved_votes"]
    return enough & (share >= settings["moved_fraction"])
