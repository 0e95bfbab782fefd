"""Give new sequences their splits without moving any old one."""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from card.splits.drives import Drive, Unit, read_drives
from card.splits.first import deviation, first_assignment
from card.splits.groups import Group, close_pairs, make_groups
from card.splits.later import later_assignment
from card.splits.ledger import ASSIGNED, ZERO_SHOT, Row, append_rows, read_ledger
from card.splits.single_frames import frame_rows
from card.splits.tracks import read_anchors

logger = logging.getLogger("card")


def extend_ledger(
    *,
    sequences: Iterable[Mapping[str, Any]],
    results: Path,
    ledger: Path,
    anchors: Path,
    settings: Mapping[str, Any],
) -> list[Row]:
    """Append rows for the sequences of the sheet that the ledger does not know; return them.

    See `read_drives` for `results`, `read_anchors` for `anchors` and `choose` for what decides.
    """
    known = read_ledger(ledger)
    rows = choose(known, read_drives(sequences, results, read_anchors(anchors), settings), settings)
    if rows:
        append_rows(ledger, rows)
    return rows


def choose(known: Sequence[Row], drives: Sequence[Drive], settings: Mapping[str, Any]) -> list[Row]:
    """Rows for the `drives` that `known` lacks; old rows only count, they never move.

    Zero-shot drives are reserved first. All others form groups (`make_groups`), or in mode `frame` stand
    frame by frame. Without old rows all groups are assigned at once (`first_assignment`), else one by one
    (`later_assignment`). A group whose tracks come close to old rows takes their split; one that is close
    to several gets none, which the log says.
    """
    by_id = {drive.id: drive for drive in drives}
    old = [(row, Unit(by_id[row.sequence], row.first, row.last)) for row in known if row.sequence in by_id]
    counts: dict[str, Counter[str]] = {split: Counter() for split in ASSIGNED}
    for row, unit in old:
        if row.split != ZERO_SHOT:
            counts[row.split] += unit.counts
    new = [drive for drive in drives if drive.id not in {row.sequence for row in known}]
    reserved = [Row(drive.id, 0, None, ZERO_SHOT, Unit(drive, 0, None).stratum, drive.id)
                for drive in new if drive.role == ZERO_SHOT]  # fmt: skip
    if settings["mode"] == "frame":
        rows = frame_rows([drive for drive in new if drive.role != ZERO_SHOT], settings, counts)
    else:
        rows = _group_rows(new, old, counts, settings)
    return sorted([*reserved, *rows], key=lambda row: (row.sequence, row.first))


def _group_rows(
    new: Sequence[Drive],
    old: Sequence[tuple[Row, Unit]],
    counts: Mapping[str, Counter[str]],
    settings: Mapping[str, Any],
) -> list[Row]:
    old_groups = {(row.group, name) for row, unit in old if row.split != ZERO_SHOT for name in unit.counts}
    groups = make_groups(new, settings, Counter(name for _, name in old_groups))
    near = _near_rows(groups, old, settings["merge_distance_m"])
    fixed: dict[str, str] = {}
    free = []
    for group in groups:
        splits = {row.split for row in near[group.name]} | ({ZERO_SHOT} if group.touches_zero_shot else set())
        # What is near a zero-shot drive must not be trained on.
        splits = {"test" if split == ZERO_SHOT else split for split in splits}
        if len(splits) > 1:
            logger.warning("%s: close to rows of %s; left unassigned", group.name, ", ".join(sorted(splits)))
            continue
        free.append(group)
        if splits:
            fixed[group.name] = splits.pop()
    chosen = later_assignment(free, settings, counts, fixed)
    if not any(row.split != ZERO_SHOT for row, _ in old):
        first = first_assignment(free, settings)
        if first is not None and deviation(free, first, settings) <= deviation(free, chosen, settings):
            chosen = first
    return [
        Row(unit.drive.id, unit.first, unit.last, split, unit.stratum,
            next((row.group for row in near[group.name]), group.name))
        for group, split in zip(free, chosen, strict=True)
        for unit in group.units
        if unit.drive.role != ZERO_SHOT
    ]  # fmt: skip


def _near_rows(
    groups: Sequence[Group], old: Sequence[tuple[Row, Unit]], distance_m: float
) -> dict[str, list[Row]]:
    """Old rows that each group comes close to."""
    units = [(unit, group.name) for group in groups for unit in group.units]
    together = [unit for unit, _ in units] + [unit for _, unit in old]
    near: dict[str, list[Row]] = {group.name: [] for group in groups}
    for one, other in close_pairs(together, distance_m):
        if one < len(units) <= other:
            near[units[one][1]].append(old[other - len(units)][0])
    return near
