"""Which voxels are dynamic by what sweeps say of them: a stated deviation from supplement C."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.visibility_votes import Votes
from card.ground_truth.voxels import find, pack, unpack

Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


def contradicted(votes: Votes, quotas_met: Mask, settings: Mapping[str, Any]) -> Mask:
    """Voxels (C,) with V_dyn moved votes or more that are a large share of the comparisons.

    The quotas (C,) of supplement B say how much contradiction a voxel may take.
    """
    limit = np.where(
        quotas_met, settings["moved_fraction_quotas_met"], settings["moved_fraction_quotas_missed"]
    )
    return (votes.moved >= settings["moved_votes"]) & (votes.moved_share >= limit)


def seldom_hit(votes: Votes, settings: Mapping[str, Any]) -> Mask:
    """Voxels (C,) that rays pass `passes_per_hit` times as often as they hit them, V_dyn of them moved.

    Beside what stands still (a walker under a tree, a tyre on the road) most passes have a return near.
    """
    wanted = settings["passes_per_hit"]
    if not wanted:
        return np.zeros(len(votes.moved), dtype=np.bool_)
    seldom: Mask = votes.beside + votes.moved >= wanted * np.maximum(votes.hits, 1)
    return seldom & (votes.moved >= settings["moved_votes"])


def lone(keys: Index, dynamic: Mask, votes: Votes, settings: Mapping[str, Any]) -> Mask:
    """Dynamic voxels (C,) with `lone_voxels` or fewer others near and a moved share below eta_lone.

    What moves is larger than a voxel or two; edges that rays brush past are not.

    keys : (C,) increasing.
    """
    few = _near(keys, keys[dynamic], settings["near_voxels"]) - 1 <= settings["lone_voxels"]
    return dynamic & few & (votes.moved_share < settings["moved_fraction_lone"])


def accompanied(keys: Index, dynamic: Mask, votes: Votes, settings: Mapping[str, Any]) -> Mask:
    """Voxels (C,) with `accompanied_voxels` dynamic ones near, V_dyn moved votes and a share of eta_near.

    The underside of a car lies so low over the road that most rays that pass have a return near.

    keys : (C,) increasing.
    """
    if not settings["accompanied_voxels"]:
        return np.zeros(len(keys), dtype=np.bool_)
    near = _near(keys, keys[dynamic], settings["near_voxels"]) >= settings["accompanied_voxels"]
    accompanied: Mask = near & (votes.moved >= settings["moved_votes"])
    return accompanied & (votes.moved_share >= settings["moved_fraction_near"])


def vacated(votes: Votes, settings: Mapping[str, Any]) -> Mask:
    """Voxels (C,) with `vacated_votes` moved votes or more before the first or after the last hit.

    These must be half or more of the looks at those times.
    What stood there for long and then left (a car that waits) gets few moved votes a comparison.
    """
    if not settings["vacated_votes"]:
        return np.zeros(len(votes.moved), dtype=np.bool_)
    gone: Mask = votes.moved_elsewhen >= settings["vacated_votes"]
    return gone & (2 * votes.moved_elsewhen >= votes.elsewhen)


def is_brief(hit: tuple[Index, Index], settings: Mapping[str, Any]) -> Mask:
    """Voxels whose first and last returns (C,), (C,) ns, of the drive lie within `brief_s`."""
    brief: Mask = hit[1] - hit[0] <= settings["brief_s"] * 1e9
    return brief


def looked_through(votes: Votes, brief: Mask, settings: Mapping[str, Any]) -> Mask:
    """Brief voxels (C,) that `brief_looks` sweeps or more looked through at another time, one as moved."""
    if not settings["brief_looks"]:
        return np.zeros(len(brief), dtype=np.bool_)
    return brief & (votes.elsewhen >= settings["brief_looks"]) & (votes.moved_elsewhen >= 1)


def attached(
    keys: Index, dynamic: Mask, brief: Mask, hit: tuple[Index, Index], settings: Mapping[str, Any]
) -> Mask:
    """Dynamic voxels (C,) and the brief ones that belong to them; `reference.attached` is the same, plainly.

    A brief voxel is dynamic if `attached_voxels` dynamic voxels or more in the cube of 2 `near_voxels` + 1
    round it were hit at the same time: within `attached_gap_s` of each other. What joins may let others join.

    Parameters
    ----------
    keys : (C,) increasing. hit : (C,), (C,) ns, first and last return of the drive.
    """
    dynamic, least = dynamic.copy(), settings["attached_voxels"]
    if not least:
        return dynamic
    gap, radius = int(settings["attached_gap_s"] * 1e9), settings["near_voxels"]
    cube = [step for step in product(range(-radius, radius + 1), repeat=3) if any(step)]
    candidate = np.flatnonzero(brief & ~dynamic)
    own, (first, last) = keys[candidate], hit
    count = np.zeros(len(candidate), dtype=np.int64)
    new = np.flatnonzero(dynamic)
    while len(new):
        cells = unpack(keys[new])
        for step in cube:
            at = find(own, pack(cells + np.array(step)))
            other, at = new[at >= 0], at[at >= 0]
            one = candidate[at]
            together = (first[other] <= last[one] + gap) & (last[other] >= first[one] - gap)
            # A step leads to a voxel from one other only.
            count[at[together]] += 1
        joins = candidate[count >= least]
        new = joins[~dynamic[joins]]
        dynamic[new] = True
    return dynamic


def surrounded(keys: Index, dynamic: Mask, settings: Mapping[str, Any]) -> Mask:
    """Dynamic voxels (C,) and those they surround; `reference.attached` has the same, plainly.

    A voxel is dynamic if of the voxels in the cube of 2 `near_voxels` + 1 round it one or more, and a share
    of `surrounded_share` or more, are. What joins may let others join.

    keys : (C,) increasing.
    """
    dynamic, share = dynamic.copy(), settings["surrounded_share"]
    if not share:
        return dynamic
    radius = settings["near_voxels"]
    count = np.zeros(len(keys), dtype=np.int64)
    new = np.flatnonzero(dynamic)
    while len(new):
        count += _near(keys, keys[new], radius)
        near = np.flatnonzero(~dynamic & (count > 0))
        others = sum(high - low for low, high in _columns(keys, keys[near], radius)) - 1
        new = near[count[near] >= share * others]
        dynamic[new] = True
    return dynamic


def _near(keys: Index, of: Index, radius: int) -> Index:
    """How many of the voxels (N,) have each of `keys` (C,) in the cube of 2 radius + 1 round them."""
    steps = np.zeros(len(keys) + 1, dtype=np.int64)
    for low, high in _columns(keys, of, radius):
        np.add.at(steps, low, 1)
        np.add.at(steps, high, -1)
    return np.cumsum(steps)[:-1]


def _columns(keys: Index, of: Index, radius: int) -> Iterator[tuple[Index, Index]]:
    """Positions [low, high) in `keys` of the voxels in each column of the cubes round voxels (N,).

    Keys sort by z last, so that a column is a run of them.
    """
    cells = unpack(of)
    for x, y in product(range(-radius, radius + 1), repeat=2):
        low = np.searchsorted(keys, pack(cells + np.array([x, y, -radius])))
        yield low, np.searchsorted(keys, pack(cells + np.array([x, y, radius])), side="right")
