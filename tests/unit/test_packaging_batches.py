"""Repositories of several batches where the Hub's limits demand it."""

from pathlib import Path
from typing import Any

import pytest
from packaging_drive import SETTINGS, build_tree, sheet_row, write_drive

from card.artifacts import read_table
from card.errors import CardError
from card.packaging.batches import batch_repository, choose_batches, extend_batches, read_batches
from card.packaging.pack import pack_sequence
from card.packaging.validate import find_problems

LIMITS = {"max_files": 200, "max_bytes": 100}


def sequences(*sizes: int, files: int = 10, repository: str = "card-germany") -> list[dict[str, Any]]:
    return [
        {"id": f"s{i}", "repository": repository, "files": files, "bytes": size}
        for i, size in enumerate(sizes)
    ]


def test_what_fits_stays_in_the_repository_of_its_licence() -> None:
    assert choose_batches({}, sequences(30, 30, 40), LIMITS) == []
    assert batch_repository("card-germany", 1) == "card-germany"
    assert batch_repository("card-germany", 3) == "card-germany-batch3"


def test_bytes_and_files_call_for_further_batches() -> None:
    assert choose_batches({}, sequences(60, 60, 60, 30), LIMITS) == [("s1", 2), ("s2", 3)]
    assert choose_batches({}, sequences(1, 1, 1, files=60), LIMITS) == [("s1", 2), ("s2", 3)]


def test_licences_are_counted_apart() -> None:
    italian = [item | {"id": f"it{item['id']}"} for item in sequences(60, repository="card-italy")]
    assert choose_batches({}, sequences(60) + italian, LIMITS) == []


def test_old_rows_stay_and_new_sequences_go_where_there_is_room() -> None:
    assert choose_batches({"s0": 2}, sequences(60, 60, 30, 60), LIMITS) == [("s3", 3)]


def test_a_sequence_larger_than_a_repository_is_named() -> None:
    with pytest.raises(CardError, match=r"s0: sequence larger than a repository \(found 101 bytes"):
        choose_batches({}, sequences(101), LIMITS)


def test_the_ledger_grows_from_packages(tmp_path: Path) -> None:
    ledger = tmp_path / "batches.tsv"
    old = "sequence\tbatch\n# kept\n"
    ledger.write_text(old)
    packages = []
    for name in ("de_one", "de_two"):
        inputs = write_drive(tmp_path, sheet_row(name))
        pack_sequence(**inputs)
        packages.append({"repository": "card-germany", "package": inputs["out"]})
    listed = read_table(inputs["out"] / "inventory.parquet", "inventory").to_pydict()
    extend_batches(ledger, packages, {"max_files": 200, "max_bytes": sum(listed["size"])})
    assert ledger.read_text() == old + "de_two\t2\n"
    assert read_batches(ledger) == {"de_two": 2}
    extend_batches(ledger, packages, {"max_files": 200, "max_bytes": sum(listed["size"])})
    assert ledger.read_text() == old + "de_two\t2\n"


def test_bad_ledgers_are_named(tmp_path: Path) -> None:
    ledger = tmp_path / "batches.tsv"
    ledger.write_text("sequence\tbatch\na\t2\na\t3\n")
    with pytest.raises(CardError, match=r"sequence is in two batches \(found a"):
        read_batches(ledger)
    ledger.write_text("sequence\tbatch\na\t1\n")
    with pytest.raises(CardError, match="batch does not fit"):
        read_batches(ledger)


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ({"max_files": 10}, r"release: \d+ files, the Hub takes 10; .*assign_batches"),
        ({"max_bytes": 1000}, r"release: \d+ bytes, a repository may hold 1000"),
        ({"max_folder_entries": 5}, r"^data/de_test: 6 entries, the Hub takes 5"),
        ({"max_file_bytes": 1024}, r"^data/de_test/camera_left-000\.tar: larger than 1024 bytes"),
    ],
)
def test_a_tree_beyond_a_limit_is_not_valid(tmp_path: Path, limit: dict[str, int], message: str) -> None:
    import re

    tree = build_tree(tmp_path)
    findings = find_problems(tree, limits=SETTINGS["hub"] | limit)
    assert any(re.search(message, line) for line in findings), findings
    assert find_problems(tree, limits=SETTINGS["hub"]) == []
