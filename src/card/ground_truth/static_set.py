"""The static voxels of a drive: voting, rigidity, dynamic pruning (paper, supplement A-C)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts import progress
from card.ground_truth.dynamic_voxels import (
    accompanied,
    attached,
    contradicted,
    is_brief,
    lone,
    looked_through,
    seldom_hit,
    surrounded,
    vacated,
)
from card.ground_truth.icp_flow import dynamic_by_flow, flow_votes
from card.ground_truth.quotas import meets_quotas
from card.ground_truth.sweeps import Drive
from card.ground_truth.visibility_votes import evidence_sweeps, hit_times, visibility_votes
from card.ground_truth.voxel_map import VoxelMap, build_voxel_map
from card.ground_truth.voxels import VoxelGrid


@dataclass(frozen=True)
class StaticSet:
    """keys: (V,) increasing. counts: (V,) int32 points of the drive. why: voxels lost to each test."""

    grid: VoxelGrid
    keys: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int32]
    why: dict[str, int]


def static_voxels(drive: Drive, settings: Mapping[str, Any]) -> StaticSet:
    """The global static voxel set, computed once a drive."""
    grid = VoxelGrid.around(drive.trajectory, settings["voxel_size_m"])
    why = {"points_at_sensor_origin": 0, "points_cropped": 0, "points": 0}
    voxels = build_voxel_map(_stream(drive, why), drive.origins, grid, settings)
    static = prune(drive, voxels, settings)
    return replace(static, why=why | static.why)


def prune(drive: Drive, voxels: VoxelMap, settings: Mapping[str, Any]) -> StaticSet:
    """The voxels of a drive's map that stand still.

    With `flow_method` "literal", "submap" or "off" the quotas decide, as in the paper, and the first two
    prune by ICP flow. With "visibility" a voxel that both LiDARs hit is kept unless what sweeps say of it
    contradicts it (`dynamic_voxels`).
    """
    quotas = meets_quotas(voxels.front_views, voxels.rear_views, voxels.baseline, settings)
    rigid = voxels.extents <= settings["rigidity_m"]
    method = settings["flow_method"]
    candidate = (voxels.hit_by_both if method == "visibility" else quotas) & rigid
    chosen = np.flatnonzero(candidate)
    dynamic = np.zeros(len(chosen), dtype=np.bool_)
    reasons: dict[str, int] = {}
    if method == "visibility":
        dynamic, reasons = _dynamic_by_visibility(drive, voxels, chosen, quotas[chosen], settings)
    elif method != "off":
        dynamic = dynamic_by_flow(flow_votes(drive, voxels, settings), settings)[chosen]
    static = chosen[~dynamic]
    why = {
        "voxels": len(voxels.keys),
        "voxels_hit_by_both": int(voxels.hit_by_both.sum()),
        "voxels_quotas_met": int(quotas.sum()),
        "voxels_not_rigid": int((~rigid).sum()),
        **reasons,
        "voxels_dynamic": int(dynamic.sum()),
        "voxels_static": len(static),
    }
    return StaticSet(voxels.grid, voxels.keys[static], voxels.counts[static], why)


def _dynamic_by_visibility(
    drive: Drive,
    voxels: VoxelMap,
    chosen: npt.NDArray[np.int64],
    quotas_met: npt.NDArray[np.bool_],
    settings: Mapping[str, Any],
) -> tuple[npt.NDArray[np.bool_], dict[str, int]]:
    """Which of the chosen voxels (C,) are dynamic, and how many each test found that none before it did."""
    sweeps = evidence_sweeps(drive, settings)
    votes = visibility_votes(drive, progress(sweeps, "moved votes"), voxels, chosen, settings)
    hit = hit_times(drive, voxels, chosen)
    brief = is_brief(hit, settings)
    keys, dynamic, reasons = voxels.keys[chosen], np.zeros(len(chosen), dtype=np.bool_), {}

    def count(reason: str, found: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        reasons[f"voxels_{reason}"] = int((found & ~dynamic).sum())
        return dynamic | found

    doubtful = contradicted(votes, quotas_met, settings)
    dynamic = count("vacated", vacated(votes, settings))
    dynamic = count("looked_through", looked_through(votes, brief, settings))
    dynamic = count("seldom_hit", seldom_hit(votes, settings))
    spared = lone(keys, dynamic | doubtful, votes, settings)
    dynamic = count("contradicted", doubtful & ~spared)
    dynamic = count("attached", attached(keys, dynamic, brief, hit, settings))
    dynamic = count("surrounded", surrounded(keys, dynamic, settings))
    dynamic = count("accompanied", accompanied(keys, dynamic, votes, settings))
    return dynamic, reasons


def _stream(drive: Drive, why: dict[str, int]) -> Iterator[tuple[int, bool, npt.NDArray[np.float64]]]:
    for i in progress(range(len(drive)), "voxel map"):
        sweep = drive.sweep(i)
        why["points_at_sensor_origin"] += sweep.at_origin
        why["points_cropped"] += sweep.cropped
        why["points"] += len(sweep.points)
        yield i, bool(drive.front[i]), sweep.points
