"""What belongs to dynamic voxels in plain numpy: the same as `dynamic_voxels.attached` and `surrounded`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.voxels import unpack

Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


def attached(
    keys: Index, dynamic: Mask, brief: Mask, hit: tuple[Index, Index], settings: Mapping[str, Any]
) -> Mask:
    """See `dynamic_voxels.attached`: rounds over all pairs of voxels until none joins."""
    cells, (first, last) = unpack(keys), hit
    gap = int(settings["attached_gap_s"] * 1e9)
    near = np.abs(cells[:, None] - cells).max(axis=2, initial=0) <= settings["near_voxels"]
    together = (first[:, None] <= last + gap) & (last[:, None] >= first - gap)
    least = settings["attached_voxels"]
    while least:
        joins = brief & ~dynamic & ((near & together)[:, dynamic].sum(axis=1) >= least)
        if not joins.any():
            break
        dynamic = dynamic | joins
    return dynamic.copy()


def surrounded(keys: Index, dynamic: Mask, settings: Mapping[str, Any]) -> Mask:
    """See `dynamic_voxels.surrounded`: rounds over all pairs of voxels until none joins."""
    cells = unpack(keys)
    near = np.abs(cells[:, None] - cells).max(axis=2, initial=0) <= settings["near_voxels"]
    others = near.sum(axis=1) - 1
    share = settings["surrounded_share"]
    while share:
        count = near[:, dynamic].sum(axis=1)
        joins = ~dynamic & (count > 0) & (count >= share * others)
        if not joins.any():
            break
        dynamic = dynamic | joins
    return dynamic.copy()
