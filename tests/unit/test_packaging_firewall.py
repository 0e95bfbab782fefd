"""The firewall between licences, breached in every way."""

import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from packaging_drive import FRAMES, LICENSES, assemble_tree, sheet_row, write_drive, write_splits
from packaging_faults import cell, field, text

from card.artifacts import read_json, read_table
from card.cli import main
from card.errors import CardError
from card.packaging.firewall import check_firewall
from card.packaging.pack import pack_sequence
from card.packaging.reader import Release

COUNTRIES = LICENSES["countries"]
BY, NC = "CC-BY-4.0", "CC-BY-NC-4.0"


def packed(work: Path, name: str, country: str, seed: int) -> dict[str, Any]:
    inputs = write_drive(work, sheet_row(name, country=country, place=f"place-{country}"), seed)
    pack_sequence(**inputs)
    splits = write_splits(work / "results" / name / "splits.parquet", ["train"] * FRAMES)
    return {"id": name, "package": inputs["out"], "splits": splits}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    work = tmp_path_factory.mktemp("firewall")
    assemble_tree(work, [packed(work, "de_one", "DE", 0)], BY)
    assemble_tree(work, [packed(work, "it_one", "IT", 1)], NC)
    return work / "results" / "release"


@pytest.fixture
def trees(built: Path, tmp_path: Path) -> list[Path]:
    shutil.copytree(built, tmp_path / "release", ignore=shutil.ignore_patterns("*.json.report"))
    return [tmp_path / "release" / name for name in ("card-germany", "card-italy")]


def test_trees_that_share_nothing_pass(trees: list[Path], tmp_path: Path) -> None:
    check_firewall(trees, COUNTRIES, tmp_path / "report.json")
    assert read_json(tmp_path / "report.json", "report")["counts"]["trees"] == 2


def sneak_member(trees: list[Path]) -> None:
    italian = pq.read_table(trees[1] / "metadata/members.parquet")
    index = italian["modality"].to_pylist().index("ground_truth")
    cell("metadata/members.parquet", "sha256", 0, italian["sha256"][index].as_py())(trees[0])


def sneak_thumbnail(trees: list[Path]) -> None:
    image = pq.read_table(trees[1] / "mini/mini.parquet")["image"][0].as_py()
    cell("mini/mini.parquet", "image", 0, image)(trees[0])


def sneak_source(trees: list[Path]) -> None:
    sources = json.loads((trees[1] / "sequences/it_one/provenance.json").read_text())["sources"]
    field("sequences/de_one/provenance.json", "sources", "poses", value=sources["poses"])(trees[0])


def sneak_statistic(trees: list[Path]) -> None:
    text("README.md", "# ", "it_one has 6 frames\n# ")(trees[0])


BREACHES: dict[str, tuple[Any, str]] = {
    "a file": (sneak_member, r"de_one/000000.* in card-germany is it_one/.*ground_truth\.npz in card-italy"),
    "a thumbnail": (sneak_thumbnail, r"thumbnail of de_one .* is thumbnail of it_one"),
    "what it was made from": (sneak_source, r"poses of de_one in card-germany is poses of it_one"),
    "a statistic": (sneak_statistic, r"README\.md in card-germany names it_one"),
    "a row of a table": (
        lambda trees: cell("metadata/frames-train.parquet", "sequence", 0, "it_one")(trees[0]),
        r"frames-train\.parquet in card-germany names it_one",
    ),
    "a file name": (
        lambda trees: shutil.copytree(trees[1] / "data/it_one", trees[0] / "data/it_one"),
        r"data/it_one/.* in card-germany names it_one",
    ),
    "a place": (
        lambda trees: cell("metadata/sequences.parquet", "country", 0, "IT")(trees[0]),
        r"de_one is from IT, under CC-BY-NC-4\.0, but in card-germany under CC-BY-4\.0",
    ),
}


@pytest.mark.parametrize("name", BREACHES)
def test_each_breach_is_found(name: str, trees: list[Path], tmp_path: Path) -> None:
    breach, message = BREACHES[name]
    breach(trees)
    with pytest.raises(CardError, match=rf"licences are mixed: .*{message}"):
        check_firewall(trees, COUNTRIES, tmp_path / "report.json")
    assert not (tmp_path / "report.json").exists()


def test_a_calibration_session_may_be_shared(trees: list[Path]) -> None:
    own = [json.loads((tree / f"sequences/{name}/provenance.json").read_text())["sources"]["calibration"]
           for tree, name in zip(trees, ("de_one", "it_one"), strict=True)]  # fmt: skip
    assert own[0] == own[1]
    check_firewall(trees, COUNTRIES)


def test_changing_a_country_moves_everything(tmp_path: Path) -> None:
    item = packed(tmp_path, "drive_one", "DE", 0)
    german = assemble_tree(tmp_path, [item], BY)
    before = {name: Release(german).read(key[0], key[2], key[1]) for key, name in Release(german).names()}
    shutil.rmtree(tmp_path / "results" / "drive_one")
    shutil.rmtree(tmp_path / "recordings")
    item = packed(tmp_path, "drive_one", "IT", 0)
    german = assemble_tree(tmp_path, [], BY)
    italian = assemble_tree(tmp_path, [item], NC)
    check_firewall([german, italian], COUNTRIES)
    # Nothing of it is left where it was: no file, no row, no byte.
    left = b"\0".join(path.read_bytes() for path in sorted(german.rglob("*")) if path.is_file())
    assert b"drive_one" not in left
    assert not (german / "data").exists()
    assert not any(
        content[len(content) // 2 :][:24] in left for content in before.values() if len(content) > 500
    )
    for path in german.rglob("*.parquet"):
        if path.name != "files.parquet":
            assert pq.read_table(path).num_rows == 0, path
    release = Release(italian)
    assert {name for _, name in release.names()} == set(before)
    rows = read_table(italian / "metadata/files.parquet", "release_files").to_pylist()
    assert {row["spdx"] for row in rows} == {NC}
    assert {row["spdx"] for row in release.frames()} == {NC}


def test_command_line(trees: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    licenses = Path(__file__).resolve().parents[2] / "config" / "licenses.yaml"
    assert main(["firewall", *map(str, trees), "--licenses", str(licenses)]) == 0
    sneak_statistic(trees)
    assert main(["firewall", *map(str, trees), "--licenses", str(licenses)]) == 1
    assert "licences are mixed" in capsys.readouterr().err
