"""Give new sequences a split without moving any old one."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.artifacts import read_table
from card.errors import CardError
from card.splits.ledger import ASSIGNED, ZERO_SHOT, Row, append_rows, read_ledger
from card.splits.strata import frame_topographies, sequence_topography, stratum


@dataclass(frozen=True)
class Drive:
    """What the assignment knows of a sequence; `frames` are its sampled frames."""

    id: str
    role: str
    frames: tuple[int, ...]
    stratum: str


def extend_ledger(
    *, sequences: Iterable[Mapping[str, Any]], results: Path, ledger: Path, settings: Mapping[str, Any]
) -> list[Row]:
    """Append rows for the sequences of the sheet that the ledger does not know; return them.

    `results` holds each sequence's `frames`, `labels` and `label_states` tables. CardError when a
    sequence has not been processed that far, because its length and topography decide. A sequence
    in quarantine or without left images gets no row.
    """
    known = read_ledger(ledger)
    drives = [
        _drive(sequence, results / sequence["id"], settings)
        for sequence in sequences
        if "camera_left" in sequence["modalities"] and not sequence["quarantine"]
    ]
    rows = choose(known, drives, settings)
    if rows:
        append_rows(ledger, rows)
    return rows


def choose(known: Sequence[Row], drives: Sequence[Drive], settings: Mapping[str, Any]) -> list[Row]:
    """Rows for the `drives` that `known` lacks: whole sequences, longest first.

    Each goes to the split with the largest deficit against its target share, in sampled frames, summed
    over the whole set and its stratum; of equal deficits the smaller split wins. Zero-shot drives are
    recorded as reserved. Old rows only count, they never move.
    """
    shares = {split: settings[f"{split}_share"] for split in ASSIGNED}
    total: Counter[str] = Counter()
    strata: dict[str, Counter[str]] = {}
    by_id = {drive.id: drive for drive in drives}
    for row in known:
        drive = by_id.get(row.sequence)
        if drive and row.split != ZERO_SHOT:
            size = sum(map(row.covers, drive.frames))
            total[row.split] += size
            strata.setdefault(row.stratum, Counter())[row.split] += size

    old = {row.sequence for row in known}
    new = sorted(
        (drive for drive in drives if drive.id not in old), key=lambda drive: (-len(drive.frames), drive.id)
    )
    rows = []
    for drive in new:
        split = ZERO_SHOT
        if drive.role != ZERO_SHOT:
            size = len(drive.frames)
            inside = strata.setdefault(drive.stratum, Counter())
            deficit = {
                name: share * (total.total() + inside.total() + 2 * size) - total[name] - inside[name]
                for name, share in shares.items()
            }
            split = min(ASSIGNED, key=lambda name: (-round(deficit[name], 6), total[name]))
            total[split] += size
            inside[split] += size
        rows.append(Row(drive.id, 0, None, split, drive.stratum, group=drive.id))
    return sorted(rows, key=lambda row: row.sequence)


def _drive(sequence: Mapping[str, Any], folder: Path, settings: Mapping[str, Any]) -> Drive:
    paths = {name: folder / f"{name}.parquet" for name in ("frames", "labels", "label_states")}
    for path in paths.values():
        if not path.exists():
            raise CardError(
                "the sequence is not processed yet",
                where=f"sequence {sequence['id']}",
                found=f"no {path}",
                wanted="`snakemake release` first, then assign its split",
            )
    frames = read_table(paths["frames"], "frames")["frame"].to_pylist()
    topographies = frame_topographies(
        read_table(paths["labels"], "labels").to_pydict(),
        read_table(paths["label_states"], "label_states").to_pydict(),
        sequence["off_road"],
    )
    return Drive(
        id=sequence["id"],
        role=sequence["role"],
        frames=tuple(f for f in frames if f % settings["frame_step"] == settings["frame_offset"]),
        stratum=stratum(sequence_topography(topographies.values()), sequence["place"]),
    )
