"""The version that changes call for."""

from pathlib import Path
from typing import Any

import pytest
from packaging_drive import FRAMES, assemble_tree, sheet_row, write_drive, write_splits

from card.artifacts import read_json
from card.errors import CardError
from card.packaging.pack import pack_sequence
from card.packaging.versions import latest_records, next_version

STATES = ["train", "unassigned"] * 3


def item(work: Path, name: str = "de_test", splits: list[str] | None = None, **cells: Any) -> dict[str, Any]:
    inputs = write_drive(work, sheet_row(name, **cells))
    pack_sequence(**inputs)
    table = write_splits(work / "results" / name / "splits.parquet", splits or STATES)
    return {"id": name, "package": inputs["out"], "splits": table}


@pytest.fixture
def old(tmp_path: Path) -> Path:
    return assemble_tree(tmp_path / "old", [item(tmp_path / "old")], version="1.2.3")


def bump(tree: Path) -> Any:
    return read_json(tree / "changes.json", "changes")["bump"]


def test_the_first_release_adds_everything(old: Path) -> None:
    changes = read_json(old / "changes.json", "changes")
    assert (changes["from"], changes["to"], changes["sequences"]["added"]) == (None, "1.2.3", ["de_test"])
    assert changes["files"] == {"removed": [], "edited": [], "added": 4 + 5 * FRAMES}


def test_other_pages_are_a_patch(old: Path, tmp_path: Path) -> None:
    tree = assemble_tree(tmp_path, [item(tmp_path)], version="1.2.4", previous=old)
    assert bump(tree) == "patch"


def test_a_new_sequence_is_a_minor_version(old: Path, tmp_path: Path) -> None:
    both = [item(tmp_path), item(tmp_path, "de_two")]
    with pytest.raises(CardError, match=r"call for a minor version \(found 1.2.4, wanted at least 1.3.0"):
        assemble_tree(tmp_path, both, version="1.2.4", previous=old)
    assert not (tmp_path / "results" / "release" / "card-germany").exists()
    assert bump(assemble_tree(tmp_path, both, version="1.3.0", previous=old)) == "minor"


def test_a_first_split_is_a_minor_version(old: Path, tmp_path: Path) -> None:
    splits = ["train", "test", *STATES[2:]]
    tree = assemble_tree(tmp_path, [item(tmp_path, splits=splits)], version="1.3.0", previous=old)
    assert bump(tree) == "minor"
    assert read_json(tree / "changes.json", "changes")["assigned_frames"] == 1


def test_an_edited_row_or_file_is_a_major_version(old: Path, tmp_path: Path) -> None:
    tree = assemble_tree(tmp_path, [item(tmp_path, place="elsewhere")], version="2.0.0", previous=old)
    changes = read_json(tree / "changes.json", "changes")
    assert changes["bump"] == "major"
    assert len(changes["frames"]["edited"]) == FRAMES
    with pytest.raises(CardError, match=r"call for a major version \(found 1.9.0, wanted at least 2.0.0"):
        assemble_tree(tmp_path, [item(tmp_path / "again", place="elsewhere")], version="1.9.0", previous=old)


@pytest.mark.parametrize("split", ["test", "unassigned"])
def test_a_released_frame_may_not_move(old: Path, tmp_path: Path, split: str) -> None:
    with pytest.raises(
        CardError, match=rf"de_test frame 0: .*moved to another split \(found {split}, wanted train"
    ):
        assemble_tree(tmp_path, [item(tmp_path, splits=[split, *STATES[1:]])], version="9.0.0", previous=old)


def test_versions_rise_by_their_parts() -> None:
    assert [next_version("1.2.3", part) for part in ("major", "minor", "patch", "none")] == [
        "2.0.0", "1.3.0", "1.2.4", "1.2.3",
    ]  # fmt: skip


def test_the_last_record_is_the_highest_version_below(tmp_path: Path) -> None:
    assert latest_records(tmp_path, "card-germany", "1.0.0") == []
    for version in ("0.9.0", "0.10.0", "1.0.0"):
        folder = tmp_path / "card-germany" / version
        folder.mkdir(parents=True)
        (folder / "release.json").write_text("{}")
    found = latest_records(tmp_path, "card-germany", "1.0.0")
    assert [path.name for path in found] == ["0.10.0", "1.0.0"]
    assert [path.name for path in latest_records(tmp_path, "card-germany", "2.0.0")] == ["1.0.0"]


def test_a_version_that_was_sent_stands(old: Path, tmp_path: Path) -> None:
    again = assemble_tree(tmp_path, [item(tmp_path)], version="1.2.3", previous=old)
    assert (again / "SHA256SUMS").read_bytes() == (old / "SHA256SUMS").read_bytes()
    with pytest.raises(CardError, match=r"call for a minor version \(found 1.2.3, wanted at least 1.3.0"):
        assemble_tree(
            tmp_path, [item(tmp_path / "x"), item(tmp_path / "y", "de_two")], version="1.2.3", previous=old
        )
