"""Mode `frame`: every sampled frame by itself, as in the paper; neighbours end up in different splits."""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from card.splits.drives import Drive
from card.splits.ledger import ASSIGNED, Row


def frame_rows(
    drives: Sequence[Drive], settings: Mapping[str, Any], known: Mapping[str, Counter[str]]
) -> list[Row]:
    """Ledger rows of all sampled frames of the drives, stratum by stratum.

    The frames of a stratum, in an order that looks random but always repeats, each go to the split with the
    largest deficit. Frames that follow each other and share split and stratum share a row.
    """
    counts = {split: Counter(known.get(split, {})) for split in ASSIGNED}
    members: dict[str, list[tuple[str, int]]] = {}
    for drive in drives:
        for frame, name, sampled in zip(drive.frames.tolist(), drive.strata, drive.sampled, strict=True):
            if sampled:
                members.setdefault(name, []).append((drive.id, frame))
    splits: dict[tuple[str, int], tuple[str, str]] = {}
    for name, frames in sorted(members.items()):
        for key in sorted(frames, key=_shuffled):
            size = sum(count[name] for count in counts.values()) + 1
            split = max(ASSIGNED, key=lambda split: settings[f"{split}_share"] * size - counts[split][name])
            counts[split][name] += 1
            splits[key] = split, name
    return [row for drive in drives for row in _runs(drive, splits)]


def _shuffled(key: tuple[str, int]) -> str:
    return hashlib.sha256(f"{key[0]}/{key[1]}".encode()).hexdigest()


def _runs(drive: Drive, splits: Mapping[tuple[str, int], tuple[str, str]]) -> list[Row]:
    rows: list[Row] = []
    for frame in drive.frames[drive.sampled].tolist():
        split, stratum = splits[drive.id, frame]
        goes_on = bool(rows) and (rows[-1].split, rows[-1].stratum) == (split, stratum)
        first = rows.pop().first if goes_on else frame
        rows.append(Row(drive.id, first, frame, split, stratum, f"{drive.id}:{first}"))
    return rows
