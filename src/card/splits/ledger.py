"""The committed, append-only ledger that says which frames belong to which split."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from card.artifacts import atomic_file, read_sheet
from card.errors import CardError

ASSIGNED = ("train", "validation", "test")
ZERO_SHOT, UNASSIGNED = "zero_shot", "unassigned"
SPLITS = (*ASSIGNED, ZERO_SHOT, UNASSIGNED)
COLUMNS = ("sequence", "first_frame", "last_frame", "split", "stratum", "group")
SCHEMA = "splits_ledger"


@dataclass(frozen=True)
class Row:
    """Frames `first..last` of a sequence, both included; `last` None means to the end."""

    sequence: str
    first: int
    last: int | None
    split: str
    stratum: str
    group: str

    def covers(self, frame: int) -> bool:
        return self.first <= frame and (self.last is None or frame <= self.last)

    def cells(self) -> list[str]:
        last = "-" if self.last is None else str(self.last)
        return [self.sequence, str(self.first), last, self.split, self.stratum, self.group]


def parse(rows: Iterable[Mapping[str, Any]]) -> list[Row]:
    """Ledger rows from cells, ordered by sequence and frame.

    CardError for an unknown split, a range that ends before it starts, rows that overlap, and a
    zero-shot row that does not reserve its whole sequence.
    """
    parsed = sorted((_row(cells) for cells in rows), key=lambda row: (row.sequence, row.first))
    for row in parsed:
        if row.split not in (*ASSIGNED, ZERO_SHOT):
            raise CardError(
                "unknown split", where=_where(row), found=row.split, wanted=" | ".join((*ASSIGNED, ZERO_SHOT))
            )
        if row.last is not None and row.last < row.first:
            raise CardError(
                "range ends before it starts", where=_where(row), found=row.last, wanted=f">= {row.first}"
            )
        if row.split == ZERO_SHOT and (row.first, row.last) != (0, None):
            raise CardError(
                "zero-shot sequences are reserved whole",
                where=_where(row),
                found=f"{row.cells()[1]}..{row.cells()[2]}",
                wanted="0..-",
            )
    for before, after in pairwise(parsed):
        if before.sequence == after.sequence and (before.last is None or after.first <= before.last):
            raise CardError(
                "rows overlap",
                where=_where(after),
                found=f"first_frame {after.first}",
                wanted=f"after the row from {before.first} to {before.cells()[2]}",
            )
    return parsed


def read_ledger(path: Path) -> list[Row]:
    """Rows of the ledger file, checked as in `parse`."""
    return parse(read_sheet(path, SCHEMA))


def append_rows(path: Path, rows: Iterable[Row]) -> None:
    """Add `rows` at the end of the ledger; what stands in it keeps its bytes."""
    old = path.read_text(encoding="utf-8")
    new = old + "\n" * (not old.endswith("\n")) + "".join("\t".join(row.cells()) + "\n" for row in rows)
    check_append_only(old, new)
    with atomic_file(path) as temporary:
        temporary.write_text(new, encoding="utf-8")


def check_append_only(old: str, new: str) -> None:
    """CardError naming the first line of the ledger text `old` that `new` changed, moved or dropped."""
    after = new.splitlines()
    for number, line in enumerate(old.splitlines(), start=1):
        found = after[number - 1] if number <= len(after) else "nothing"
        if found != line:
            raise CardError(
                "the split ledger is append-only", where=f"line {number}", found=found, wanted=line
            )


def _row(cells: Mapping[str, Any]) -> Row:
    last = cells["last_frame"]
    return Row(
        sequence=str(cells["sequence"]),
        first=int(cells["first_frame"]),
        last=None if last in ("-", None) else int(last),
        split=str(cells["split"]),
        stratum=str(cells["stratum"]),
        group=str(cells["group"]),
    )


def _where(row: Row) -> str:
    return f"split ledger, {row.sequence} from {row.first}"
