"""The dataset card tells what the release is worth."""

from pathlib import Path

import pytest
import yaml
from packaging_drive import (
    FRAMES,
    assemble_tree,
    build_tree,
    sheet_row,
    write_drive,
    write_gated_report,
    write_splits,
)

from card.artifacts import Figure, write_report
from card.packaging.pack import pack_sequence
from card.packaging.summary import summarize
from card.packaging.validate import find_problems


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("card"))


def test_pages_carry_the_licence_and_the_citation(tree: Path) -> None:
    citation = yaml.safe_load((tree / "CITATION.cff").read_text())
    assert (citation["license"], citation["type"]) == ("CC-BY-4.0", "dataset")
    assert "recorded in Germany" in (tree / "NOTICE").read_text()
    card = (tree / "README.md").read_text()
    assert "| de_test | test-town | town | 6 | 4 | 2 | 1 |" in card


def test_an_override_is_told_in_card_and_summary(tmp_path: Path) -> None:
    inputs = write_drive(tmp_path, sheet_row())
    override = {"figure": "residual", "signed_by": "A. Person", "reason": "gravel"}
    report = write_gated_report(tmp_path / "wheels.report.json", "de_test", 0.03, [override])
    pack_sequence(**inputs | {"reports": inputs["reports"] | {"wheels": report}})
    splits = write_splits(tmp_path / "splits.parquet", ["unassigned"] * FRAMES, group=None)
    tree = assemble_tree(tmp_path, [{"id": "de_test", "package": inputs["out"], "splits": splits}])
    assert "released because gravel (signed by A. Person)" in (tree / "README.md").read_text()
    text = summarize(tree.parent)
    assert "gates: 0 passed, 0 failed, 1 overridden" in text
    assert "gravel (signed by A. Person): de_test\n" in text
    assert "no split yet: de_test; run `snakemake assign_splits`" in text
    assert "NOT VALIDATED" in text


@pytest.mark.parametrize(
    ("mode", "says"), [("group", "kept in one split"), ("frame", "neighbours are in different")]
)
def test_the_card_tells_what_the_splits_are_worth(tmp_path: Path, mode: str, says: str) -> None:
    inputs = write_drive(tmp_path, sheet_row())
    pack_sequence(**inputs)
    splits = write_splits(tmp_path / "splits.parquet", ["train"] * FRAMES)
    report = tmp_path / "splits.report.json"
    write_report(
        report,
        stage="split_report",
        settings={"mode": mode},
        inputs={},
        counts={"test_measured": 9, "test_apart": 0, "test_unknown": 2},
        figures=[Figure("leak_m_p5", 41.6, "m", "x"), Figure("stratum_deviation", 0.0312, "1", "x")],
    )
    item = {"id": "de_test", "package": inputs["out"], "splits": splits}
    tree = assemble_tree(tmp_path, [item], split_report=report)
    card = " ".join((tree / "README.md").read_text().split())
    assert says in card
    assert "95 % of the test frames lie 42 m or more from the nearest training frame. 2 test frames" in card
    assert "off their targets by 0.031 on average" in card
    assert find_problems(tree) == []
