"""The splits of the tree are those of the committed ledger."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from card.packaging.checks.contents import Contents


def check_splits(contents: Contents, ledger: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Each frame's split follows from the ledger row that covers it; zero-shot sequences are whole."""
    ranges: dict[str, list[tuple[int, float, str]]] = {}
    for row in ledger:
        last = float("inf") if row["last_frame"] == "-" else int(row["last_frame"])
        ranges.setdefault(row["sequence"], []).append((int(row["first_frame"]), last, row["split"]))
    splits: dict[str, set[str]] = {}
    for frame in contents.all_frames():
        covering = (
            split
            for first, last, split in ranges.get(frame["sequence"], ())
            if first <= frame["frame"] <= last
        )
        wanted = next(covering, "unassigned") if frame["sampled"] else "unassigned"
        # A zero-shot sequence may be released before its row is written: the sheet reserves it.
        if frame["split"] != wanted and (frame["split"], wanted) != ("zero_shot", "unassigned"):
            where = f"metadata/frames-{frame['split']}.parquet: {frame['sequence']} frame {frame['frame']}"
            yield f"{where} belongs to {wanted} by the split ledger"
        splits.setdefault(frame["sequence"], set()).add(frame["split"])
    for sequence, found in sorted(splits.items()):
        if "zero_shot" in found and len(found) > 1:
            yield f"metadata/frames: {sequence} is zero-shot in part only ({', '.join(sorted(found))})"
