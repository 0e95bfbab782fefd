"""Groups of units that never part: tracks that come close belong together."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from card.splits.drives import Drive, Unit
from card.splits.ledger import ASSIGNED, ZERO_SHOT


@dataclass(frozen=True)
class Group:
    """Units that get one split, by name; the first gives the group its name."""

    units: tuple[Unit, ...]

    @property
    def name(self) -> str:
        return self.units[0].name

    @cached_property
    def counts(self) -> Counter[str]:
        """Sampled frames by stratum, zero-shot drives left out."""
        units = [unit.counts for unit in self.units if unit.drive.role != ZERO_SHOT]
        return sum(units, Counter())

    @property
    def touches_zero_shot(self) -> bool:
        return any(unit.drive.role == ZERO_SHOT for unit in self.units)


def make_groups(
    drives: Sequence[Drive], settings: Mapping[str, Any], known: Mapping[str, int] | None = None
) -> list[Group]:
    """Groups of drives; those of a stratum that has too few to fill all splits are cut into blocks.

    `known` counts the groups of each stratum that are there already.
    """
    whole = [Unit(drive, 0, None) for drive in drives]
    groups = merge(whole, settings["merge_distance_m"])
    found = Counter(known or {}) + Counter(stratum for group in groups for stratum in group.counts)
    poor = {stratum for stratum, count in found.items() if count < len(ASSIGNED)}
    cut = [
        part
        for unit in whole
        for part in (
            blocks(unit.drive, settings)
            if poor & set(unit.counts) and unit.drive.role != ZERO_SHOT
            else [unit]
        )
    ]
    return merge(cut, settings["merge_distance_m"]) if len(cut) > len(whole) else groups


def blocks(drive: Drive, settings: Mapping[str, Any]) -> list[Unit]:
    """The drive in blocks of `block_min_s` to `block_max_s` with gaps of at least `guard_gap_s` between them.

    As few blocks as the longest length allows; a drive too short for two stays whole.
    """
    shortest, longest, gap = (settings[name] for name in ("block_min_s", "block_max_s", "guard_gap_s"))
    if not drive.frames.size:
        return [Unit(drive, 0, None)]
    seconds = (drive.t_ns - drive.t_ns[0]) / 1e9
    total = float(seconds[-1])
    count = int(np.ceil((total + gap) / (longest + gap)))
    length = (total - (count - 1) * gap) / count
    if length < shortest:
        count, length = count - 1, longest
    if count < 2:
        return [Unit(drive, 0, None)]
    step = (total - length) / (count - 1)
    units = []
    for index in range(count):
        start = index * step
        inside = drive.frames[(seconds >= start - 1e-9) & (seconds <= start + length + 1e-9)]
        if inside.size:
            units.append(Unit(drive, int(inside[0]), None if index == count - 1 else int(inside[-1])))
    return units


def merge(units: Sequence[Unit], distance_m: float) -> list[Group]:
    """Groups of the units whose places in one map come within `distance_m` of each other."""
    ordered = sorted(units, key=lambda unit: (unit.drive.id, unit.first))
    parent = list(range(len(ordered)))

    def root(index: int) -> int:
        while parent[index] != index:
            parent[index] = parent[parent[index]]
            index = parent[index]
        return index

    for one, other in close_pairs(ordered, distance_m):
        first, second = sorted((root(one), root(other)))
        parent[second] = first
    members: dict[int, list[Unit]] = {}
    for index, unit in enumerate(ordered):
        members.setdefault(root(index), []).append(unit)
    return [Group(tuple(found)) for _, found in sorted(members.items())]


def close_pairs(units: Sequence[Unit], distance_m: float) -> list[tuple[int, int]]:
    """Pairs of indices of units that come within `distance_m` of each other in one map."""
    from scipy.spatial import cKDTree

    known = [index for index, unit in enumerate(units) if len(unit.places_m)]
    trees = {index: cKDTree(units[index].places_m) for index in known}
    pairs = []
    for position, one in enumerate(known):
        low, high = trees[one].mins - distance_m, trees[one].maxes + distance_m
        for other in known[position + 1 :]:
            apart = units[one].map != units[other].map
            if apart or (trees[other].maxes < low).any() or (trees[other].mins > high).any():
                continue
            if trees[one].count_neighbors(trees[other], distance_m):
                pairs.append((one, other))
    return pairs
