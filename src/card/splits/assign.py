"""Stage `splits`: which frames of a sequence are released in which split."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import Figure, read_table, write_report, write_table
from card.errors import CardError
from card.splits.ledger import SPLITS, UNASSIGNED, ZERO_SHOT, Row, parse
from card.splits.strata import frame_topographies, stratum


def assign(
    *,
    sequence: Mapping[str, Any],
    frames: Path,
    labels: Path,
    label_states: Path,
    rows: Sequence[Mapping[str, Any]],
    splits: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write the split of every frame of one sequence (paper, 'Dataset scale and splits').

    Every `frame_step`-th frame is sampled and takes the split of the ledger row that covers it; what is
    not sampled or not in the ledger is `unassigned`. A zero-shot sequence is reserved whole: all its
    frames, because its tasks need them in unbroken order.

    Parameters
    ----------
    sequence : row of the sequence sheet.
    rows : this sequence's rows of the split ledger.
    splits : table to write: frame, split, group, stratum, sampled.

    CardError for bad rows (see `ledger.parse`) and for rows that contradict the sheet's role.
    """
    ledger = _rows_of(sequence, rows)
    numbers = read_table(frames, "frames")["frame"].to_pylist()
    topographies = frame_topographies(
        read_table(labels, "labels").to_pydict(),
        read_table(label_states, "label_states").to_pydict(),
        sequence["off_road"],
    )
    step, offset = settings["frame_step"], settings["frame_offset"]
    columns: dict[str, list[Any]] = {"frame": numbers, "split": [], "group": [], "stratum": [], "sampled": []}
    for frame in numbers:
        row = next((row for row in ledger if row.covers(frame)), None)
        sampled = frame % step == offset
        if sequence["role"] == ZERO_SHOT:
            split, sampled = ZERO_SHOT, True
        else:
            split = row.split if row and sampled else UNASSIGNED
        columns["split"].append(split)
        columns["group"].append(row.group if row else None)
        columns["stratum"].append(stratum(topographies.get(frame, "unknown"), sequence["place"]))
        columns["sampled"].append(sampled)
    write_table(splits, columns, "splits")

    counts = Counter(columns["split"])
    outside = sum(group is None for group in columns["group"]) if sequence["role"] != ZERO_SHOT else 0
    write_report(
        report,
        stage="splits",
        sequence=sequence["id"],
        settings=settings,
        inputs={"frames": frames, "labels": labels, "label_states": label_states},
        counts={name: counts[name] for name in SPLITS},
        figures=[
            Figure(
                "frames_outside_ledger", outside, "frames", "Frames that no row of the split ledger covers"
            )
        ],
        gates=gates,
        notes=["run `snakemake assign_splits` to give this sequence its split"]
        if outside and not ledger
        else [],
    )


def _rows_of(sequence: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> list[Row]:
    rows = parse(cells)
    for row in rows:
        if row.sequence != sequence["id"]:
            raise CardError(
                "row of another sequence", where="split ledger", found=row.sequence, wanted=sequence["id"]
            )
        if (row.split == ZERO_SHOT) != (sequence["role"] == ZERO_SHOT):
            raise CardError(
                "the ledger and the sheet disagree; ledger rows are never changed, so set the role back",
                where=f"sequence {sequence['id']}",
                found=f"role {sequence['role']}",
                wanted=f"the ledger's split {row.split}",
            )
    return rows
