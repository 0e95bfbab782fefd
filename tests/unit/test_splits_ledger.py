"""The split ledger: rows, ranges, and that it only grows."""

import subprocess
from pathlib import Path

import pytest

from card.cli import main
from card.errors import CardError
from card.splits.history import check_kept
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


def git(folder: Path, *arguments: str) -> None:
    identity = ["-c", "user.name=A", "-c", "user.email=a@example.org"]
    subprocess.run(["git", "-C", folder, *identity, *arguments], check=True, capture_output=True)


@pytest.fixture
def committed(tmp_path: Path) -> Path:
    """A configuration in git, its ledger with one row, which a tag names as the last release."""
    ledger = tmp_path / "splits.tsv"
    ledger.write_text("\t".join(COLUMNS) + "\nz\t0\t-\ttrain\tnone/town\tz\n")
    (tmp_path / "config.yaml").write_text("splits_ledger: splits.tsv\n")
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "-m", "x")
    git(tmp_path, "tag", "v1.0.0")
    return ledger


def test_a_row_that_moved_since_the_last_release_is_an_error(
    committed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(committed.parent)
    check = ["splits", "check", "--config", "config.yaml", "--against", "v1.0.0"]
    append_rows(committed, [Row("a", 0, 9, "test", "none/town", "a")])
    assert main(check) == 0
    assert "2 rows, none moved since v1.0.0" in capsys.readouterr().out
    committed.write_text(committed.read_text().replace("train", "test"))
    git(committed.parent, "commit", "--quiet", "-a", "-m", "moved")
    assert check_kept(committed)  # nothing moved since the last commit
    assert main(check) == 1
    error = capsys.readouterr().err
    assert "append-only; a row was changed since v1.0.0" in error
    assert "line 2" in error
    assert "wanted z 0 - train" in error


def test_outside_git_there_is_nothing_to_compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ledger = tmp_path / "splits.tsv"
    ledger.write_text("\t".join(COLUMNS) + "\n")
    assert not check_kept(ledger)
    config = tmp_path / "config.yaml"
    config.write_text(f"splits_ledger: {ledger}\n")
    assert main(["splits", "check", "--config", str(config)]) == 1
    assert "nothing to compare with" in capsys.readouterr().err


def test_the_committed_ledger_only_grew_since_the_last_commit() -> None:
    check_kept(ROOT / "config" / "ledger" / "splits.tsv")
