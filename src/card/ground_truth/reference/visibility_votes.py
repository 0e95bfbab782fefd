"""Visibility-conditioned votes in plain numpy: the same as `ground_truth.visibility_votes`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.pass_votes import FACE, FLAT
from card.ground_truth.rays import ray_origins
from card.ground_truth.reference.crossed import crossed_voxels
from card.ground_truth.reference.surface import local_planes
from card.ground_truth.sweeps import Drive
from card.ground_truth.visibility_votes import Votes, hit_times
from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import find, pack, unpack

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


def visibility_votes(
    drive: Drive, sweeps: Iterable[int], voxels: VoxelMap, chosen: Index, settings: Mapping[str, Any]
) -> Votes:
    """See `ground_truth.visibility_votes.visibility_votes`."""
    keys, size = voxels.keys[chosen], voxels.grid.size
    surface = local_planes(voxels, chosen, settings)
    votes = Votes(*(np.zeros(len(chosen), dtype=np.int32) for _ in range(5)))
    first, last = hit_times(drive, voxels, chosen)
    margin_ns = int(settings["support_margin_s"] * 1e9)
    for i in sweeps:
        sweep = drive.sweep(i)
        if not len(sweep.points):
            continue
        origins = ray_origins(drive, i, sweep)
        offset = sweep.points - origins
        lengths = _norm(offset)
        directions = offset / lengths[:, None]
        occupied = voxels.grid.keys(sweep.points)
        hit = find(keys, np.unique(occupied[lengths <= settings["pass_max_range_m"]]))
        hit = hit[hit >= 0]
        votes.hits[hit] += 1

        place, ray = _crossings(voxels, keys, origins, directions, lengths, settings)
        index = unpack(keys[place]) + np.array(voxels.grid.first)
        centroid = index * size + voxels.centroids[chosen[place]]
        o, d, length = origins[ray], directions[ray], lengths[ray]
        away = centroid - o
        along = _dot(away, d)
        slope = np.full_like(d, 1e30)
        np.divide(1, d, out=slope, where=np.abs(d) > FLAT)
        low = index - o / size
        faces = (low + FACE) * slope, (low + (1 - FACE)) * slope
        enters, leaves = np.minimum(*faces).max(axis=1), np.maximum(*faces).min(axis=1)
        passes = (
            (along >= settings["pass_min_range_m"])
            & (along <= settings["pass_max_range_m"])
            & (length - along >= settings["pass_beyond_m"])
            & (_dot(away, away) - along * along <= settings["pass_lateral_m"] ** 2)
            & (enters <= leaves)
            & ~np.isin(place, hit)
        )
        place, ray, length, along = place[passes], ray[passes], length[passes], along[passes]
        passed = np.unique(place)
        near = passed[_have_return_near(keys[passed], np.unique(occupied), settings["near_voxels"])]
        votes.beside[near] += 1
        normal = surface.normals[place].astype(np.float32)
        off = _dot(normal, sweep.points[ray] - centroid[passes])
        clear = (np.abs(off) > settings["flow_residual_m"]) & (
            np.abs(_dot(normal, d[passes])) > settings["planar_min_incidence"]
        )
        moved = (length - along >= settings["moved_gap_m"]) & (~surface.planar[place] | clear)
        moved_from = np.setdiff1d(place[moved], near)
        votes.moved[moved_from] += 1
        seen, t_ns = np.union1d(near, moved_from), drive.end_ns[i]
        elsewhen = (t_ns < first[seen] - margin_ns) | (t_ns > last[seen] + margin_ns)
        votes.elsewhen[seen[elsewhen]] += 1
        votes.moved_elsewhen[np.intersect1d(seen[elsewhen], moved_from)] += 1
    return votes


def _crossings(
    voxels: VoxelMap,
    keys: Index,
    origins: Floats,
    directions: Floats,
    lengths: Floats,
    settings: Mapping[str, Any],
) -> tuple[Index, Index]:
    """Pairs (position in `keys`, ray) of all voxels that rays cross where they may pass."""
    size = voxels.grid.size
    near = settings["pass_min_range_m"] / size - 2
    far = np.minimum(lengths, settings["pass_max_range_m"]) / size + 2
    places, rays = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for k in range(len(lengths)):
        crossed = crossed_voxels(origins[k] / size, directions[k], near, far[k])
        place = np.unique(find(keys, pack(crossed - np.array(voxels.grid.first))))
        place = place[place >= 0]
        places.append(place)
        rays.append(np.full(len(place), k))
    return np.concatenate(places), np.concatenate(rays)


def _norm(v: Floats) -> Floats:
    return np.sqrt(_dot(v, v))


def _dot(a: Floats, b: Floats) -> Floats:
    """Dot products (N,), summed in the order of the compiled code."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def _have_return_near(keys: Index, occupied: Index, radius: int) -> npt.NDArray[np.bool_]:
    """Whether a key of `occupied` lies in the cube of 2 radius + 1 voxels round each of `keys` (K,)."""
    from scipy.spatial import cKDTree

    if not len(keys):
        return np.zeros(0, dtype=np.bool_)
    tree = cKDTree(unpack(occupied))
    distance, _ = tree.query(unpack(keys), p=np.inf, distance_upper_bound=radius + 0.5)
    return np.isfinite(distance)
