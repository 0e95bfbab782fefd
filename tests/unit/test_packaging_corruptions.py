"""Each seeded fault of a release tree is found, by the check that is there for it."""

import re
import shutil
from pathlib import Path

import pytest
from packaging_corruptions import LEDGER, SEALED, UNSEALED
from packaging_drive import SETTINGS, build_tree
from packaging_faults import field, seal

from card.errors import CardError
from card.packaging.validate import find_problems, validate


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("valid"))


@pytest.mark.parametrize("name", [*UNSEALED, *SEALED])
def test_the_fault_is_found(name: str, valid: Path, tmp_path: Path) -> None:
    tree = tmp_path / "card-germany"
    shutil.copytree(valid, tree)
    corrupt, wanted = (UNSEALED | SEALED)[name]
    corrupt(tree)
    if name in SEALED:
        seal(tree)
    findings = find_problems(tree, ledger=LEDGER)
    assert any(re.search(wanted, line) for line in findings), findings
    assert not any(str(tmp_path) in line or "\n" in line for line in findings)


def test_sealing_alone_leaves_a_valid_tree(valid: Path, tmp_path: Path) -> None:
    tree = tmp_path / "card-germany"
    shutil.copytree(valid, tree)
    seal(tree)
    assert find_problems(tree, ledger=LEDGER) == []


def test_a_croissant_with_another_hash_is_found(valid: Path, tmp_path: Path) -> None:
    tree = tmp_path / "card-germany"
    shutil.copytree(valid, tree)
    field("croissant.json", "distribution", 0, "sha256", value="0" * 64)(tree)
    assert any(line.startswith("croissant.json: sha256 of data/") for line in find_problems(tree))


@pytest.mark.parametrize("split", ["test", "zero_shot"])
def test_splits_that_are_not_the_ledgers_are_found(valid: Path, split: str) -> None:
    findings = find_problems(valid, ledger=[LEDGER[0] | {"split": split}])
    assert (
        f"metadata/frames-train.parquet: de_test frame 0 belongs to {split} by the split ledger" in findings
    )


def test_a_sampled_frame_that_the_ledger_lacks_must_be_unassigned(valid: Path) -> None:
    findings = find_problems(valid, ledger=[])
    assert [line.split(" by ")[0][-10:] for line in findings] == ["unassigned"] * 2


def test_the_error_tells_the_first_finding_and_the_number(valid: Path, tmp_path: Path) -> None:
    tree = tmp_path / "card-germany"
    shutil.copytree(valid, tree)
    (tree / "NOTICE").unlink()
    report = tmp_path / "validation.json"
    with pytest.raises(CardError, match=r"release is not valid: NOTICE: missing and 2 more, see the log"):
        validate(tree, report=report, settings=SETTINGS)
    assert not report.exists()
