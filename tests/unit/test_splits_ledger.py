"""The split ledger: rows, ranges, and that it only grows."""

from pathlib import Path

import pytest

from card.errors import CardError
from card.splits.ledger import COLUMNS, Row, append_rows, check_append_only, parse, read_ledger

ROOT = Path(__file__).resolve().parents[2]


def cells(sequence: str = "a", first: str = "0", last: str = "-", split: str = "train") -> dict[str, str]:
    return dict(zip(COLUMNS, (sequence, first, last, split, "none/town", "g"), strict=True))


def test_rows_cover_their_range_with_both_ends() -> None:
    (row,) = parse([cells(first="3", last="5")])
    assert [frame for frame in range(8) if row.covers(frame)] == [3, 4, 5]
    (open_row,) = parse([cells(first="3")])
    assert not open_row.covers(2)
    assert open_row.covers(10**6)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([cells(split="dev")], "unknown split"),
        ([cells(first="5", last="4")], "ends before it starts"),
        ([cells(last="5"), cells(first="5", last="9")], "rows overlap"),
        ([cells(), cells(first="100")], "rows overlap"),
        ([cells(split="zero_shot", last="9")], "reserved whole"),
    ],
)
def test_bad_rows_are_named(rows: list[dict[str, str]], message: str) -> None:
    with pytest.raises(CardError, match=message):
        parse(rows)


def test_rows_of_different_sequences_may_have_the_same_frames() -> None:
    assert len(parse([cells("a"), cells("b")])) == 2


def test_appending_keeps_every_byte(tmp_path: Path) -> None:
    ledger = tmp_path / "splits.tsv"
    old = "# a comment\n" + "\t".join(COLUMNS) + "\nz\t0\t-\ttrain\tnone/town\tz\n"
    ledger.write_text(old)
    append_rows(ledger, [Row("a", 0, 9, "test", "none/town", "a")])
    assert ledger.read_text() == old + "a\t0\t9\ttest\tnone/town\ta\n"
    assert [row.sequence for row in read_ledger(ledger)] == ["a", "z"]


def test_appending_to_a_ledger_without_final_newline_starts_a_line(tmp_path: Path) -> None:
    ledger = tmp_path / "splits.tsv"
    ledger.write_text("\t".join(COLUMNS))
    append_rows(ledger, [Row("a", 0, None, "test", "none/town", "a")])
    assert len(read_ledger(ledger)) == 1


@pytest.mark.parametrize(
    ("new", "line"),
    [("h\na\tx\nb\n", "line 2"), ("h\nb\na\n", "line 2"), ("h\na\n", "line 3"), ("", "line 1")],
)
def test_a_changed_moved_or_dropped_row_is_an_error(new: str, line: str) -> None:
    with pytest.raises(CardError, match=line):
        check_append_only("h\na\nb\n", new)


def test_the_committed_ledger_is_valid() -> None:
    rows = read_ledger(ROOT / "config" / "ledger" / "splits.tsv")
    assert {row.split for row in rows} == {"train", "validation", "test", "zero_shot"}
