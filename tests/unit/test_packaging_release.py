"""Release trees: complete, licensed, repeatable, and readable by others."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packaging_drive import (
    FRAMES,
    LICENSES,
    SETTINGS,
    assemble_tree,
    build_tree,
    sheet_row,
    write_drive,
    write_splits,
)

from card.artifacts import read_json, read_table, write_table
from card.cli import main
from card.errors import CardError
from card.packaging.pack import pack_sequence
from card.packaging.reader import Release
from card.packaging.summary import summarize
from card.packaging.validate import find_problems, validate

LACKING = (
    "calibration",
    "poses",
    "wheel_excitation",
    "road_planes",
    "ground_truth",
    "anonymized",
    "imu",
    "labels",
    "label_states",
)


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Work folder with one assembled tree, read by all tests and changed by none."""
    work = tmp_path_factory.mktemp("release")
    build_tree(work)
    return work


@pytest.fixture(scope="module")
def tree(work: Path) -> Path:
    return work / "results" / "release" / "card-germany"


LOADER = """
import json, sys
from datasets import get_dataset_config_names, load_dataset
for tree in sys.argv[1:]:
    rows = {name: load_dataset(tree, name).num_rows for name in get_dataset_config_names(tree)}
    if "mini" in rows:
        rows["picture"] = load_dataset(tree, "mini", split="full")[0]["image"].size
    print(json.dumps(rows | {"default": list(load_dataset(tree))}))
"""


def load_all(cache: Path, *trees: Path) -> list[Any]:
    """Rows of all configs and splits of each default, by a process of its own: offline, an empty cache."""
    environment = os.environ | {"HF_HUB_OFFLINE": "1", "HF_HOME": str(cache), "HF_DATASETS_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", LOADER, *map(str, trees)], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return [json.loads(line) for line in done.stdout.splitlines()[-len(trees) :]]


def test_a_fresh_tree_is_valid(tree: Path) -> None:
    assert find_problems(tree) == []


def test_all_five_splits_have_a_file(tree: Path) -> None:
    rows = {
        path.stem: read_table(path, "release_frames").num_rows
        for path in (tree / "metadata").glob("frames-*")
    }
    assert rows == {
        "frames-train": 2,
        "frames-validation": 0,
        "frames-test": 0,
        "frames-zero_shot": 0,
        "frames-unassigned": 4,
    }


def test_two_builds_in_different_folders_have_the_same_checksums(tree: Path, tmp_path: Path) -> None:
    other = build_tree(tmp_path / "elsewhere")
    assert (other / "SHA256SUMS").read_bytes() == (tree / "SHA256SUMS").read_bytes()


def test_checksums_hold_for_the_standard_tool(tree: Path) -> None:
    done = subprocess.run(
        ["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=tree, capture_output=True
    )
    assert done.returncode == 0, done.stderr
    listed = {line.split("  ")[1] for line in (tree / "SHA256SUMS").read_text().splitlines()}
    there = {path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file()}
    assert there - listed == {"SHA256SUMS"}


def test_no_path_of_the_machine_is_in_the_tree(tree: Path, work: Path) -> None:
    for path in tree.rglob("*"):
        if path.is_file():
            assert str(work).encode() not in path.read_bytes(), path


def test_a_rebuild_drops_what_is_no_longer_released(tmp_path: Path) -> None:
    packages = []
    for name in ("de_one", "de_two"):
        inputs = write_drive(tmp_path, sheet_row(name))
        pack_sequence(**inputs)
        splits = write_splits(inputs["out"].parent / "splits.parquet", ["train"] * FRAMES)
        packages.append({"id": name, "package": inputs["out"], "splits": splits})
    tree = assemble_tree(tmp_path, packages)
    assert (tree / "data" / "de_two").is_dir()
    assemble_tree(tmp_path, packages[:1])
    assert not (tree / "data" / "de_two").exists()
    assert find_problems(tree) == []


def test_the_licence_firewall_refuses_a_package_of_another_country(tmp_path: Path) -> None:
    inputs = write_drive(tmp_path, sheet_row("it_test", country="IT"))
    pack_sequence(**inputs)
    splits = write_splits(tmp_path / "splits.parquet", ["train"] * FRAMES)
    item = {"id": "it_test", "package": inputs["out"], "splits": splits}
    with pytest.raises(CardError, match=r"it_test, sequence\.json: .*found CC-BY-NC-4\.0, wanted CC-BY-4\.0"):
        assemble_tree(tmp_path, [item], "CC-BY-4.0")
    assert not (tmp_path / "results" / "release" / "card-germany").exists()
    tree = assemble_tree(tmp_path, [item], "CC-BY-NC-4.0")
    assert "CC-BY-NC-4.0" in (tree / "LICENSE").read_text()
    assert find_problems(tree) == []


def test_the_firewall_sees_a_single_file(tmp_path: Path) -> None:
    inputs = write_drive(tmp_path, sheet_row())
    pack_sequence(**inputs)
    columns = read_table(inputs["out"] / "members.parquet", "release_members").to_pydict()
    columns["spdx"][7] = "CC-BY-NC-4.0"
    write_table(inputs["out"] / "members.parquet", columns, "release_members")
    splits = write_splits(tmp_path / "splits.parquet", ["train"] * FRAMES)
    with pytest.raises(CardError, match=r"members\.parquet: file under another licence"):
        assemble_tree(tmp_path, [{"id": "de_test", "package": inputs["out"], "splits": splits}])


def test_splits_of_other_frames_are_refused(tmp_path: Path) -> None:
    inputs = write_drive(tmp_path, sheet_row())
    pack_sequence(**inputs)
    splits = write_splits(tmp_path / "splits.parquet", ["train"] * (FRAMES - 1))
    with pytest.raises(CardError, match="different frames"):
        assemble_tree(tmp_path, [{"id": "de_test", "package": inputs["out"], "splits": splits}])


def test_trees_load_with_datasets_with_images_and_without(tree: Path, tmp_path: Path) -> None:
    inputs = write_drive(tmp_path, sheet_row())
    empty = {name: [] for name in read_table(inputs["frames"], "frames").column_names}
    write_table(inputs["frames"], empty, "frames")
    pack_sequence(**inputs | dict.fromkeys(LACKING) | {"reports": {}})
    bare = assemble_tree(tmp_path, [{"id": "de_test", "package": inputs["out"], "splits": None}])
    assert find_problems(bare) == []
    found = load_all(tmp_path / "cache", tree, bare)
    files = 4 + 5 * FRAMES
    assert found[0]["frames"] == {"train": 2, "unassigned": 4}
    assert (found[0]["members"], found[0]["mini"]) == ({"full": files}, {"full": 2})
    assert found[0]["picture"] == [32, 24]
    assert found[0]["default"] == ["train", "unassigned"]
    assert found[1] == {"sequences": {"full": 1}, "members": {"full": 2 * FRAMES}, "default": ["full"]}


def test_the_reader_reads_each_modality_by_offset(tree: Path, work: Path) -> None:
    release = Release(tree)
    results = work / "results" / "de_test"
    frame = release.frames("train")[1]
    assert frame["frame"] == 3
    key = (frame["sequence"], frame["frame"])
    image = sorted((results / "anonymized" / "camera_left").iterdir())[3]
    assert release.read(*key, "camera_left") == image.read_bytes()
    assert release.image(*key).shape == (24, 32, 3)
    np.testing.assert_array_equal(
        release.points(*key), np.load(results / "ground_truth" / "000003.npz")["points"]
    )
    assert release.boxes(*key) == [(0, 1 / 3, 0.5, 0.3, 0.1)]
    assert release.boxes("de_test", 1) == []
    assert release.boxes("de_test", 2) is None
    assert len(release.burst("de_test", frame["lidar_rear_burst"], "lidar_rear").points) == 8
    assert release.calibration("de_test")["session"]["id"] == "2026-04-14-start"
    assert [row["frame"] for row in release.frames()] == list(range(FRAMES))


def test_the_reader_names_what_is_not_there(tree: Path) -> None:
    with pytest.raises(CardError, match=r"no such file in the release.*de_test, 99, camera_left"):
        Release(tree).read("de_test", 99, "camera_left")
    with pytest.raises(CardError, match=r"members\.parquet: file is missing"):
        Release(tree / "data")


def test_croissant_satisfies_its_own_validator(tree: Path) -> None:
    import mlcroissant

    dataset = mlcroissant.Dataset(jsonld=tree / "croissant.json")
    assert not dataset.metadata.ctx.issues.errors
    document = read_json(tree / "croissant.json", "croissant")
    hashes = {file["@id"]: file["sha256"] for file in document["distribution"]}
    shard = "data/de_test/lidar_front-000.tar"
    assert hashes[shard] == hashlib.sha256((tree / shard).read_bytes()).hexdigest()
    records = list(dataset.records("frames-train"))
    assert [record["frames-train/frame"] for record in records] == [0, 3]


def test_validation_writes_its_report_and_the_summary_says_so(tree: Path, tmp_path: Path) -> None:
    report = tmp_path / "card-germany.validation.json"
    validate(tree, report=report, settings=SETTINGS)
    assert read_json(report, "report")["counts"]["findings"] == 0
    assert "card-germany (CC-BY-4.0): 1 sequences, 6 frames, 34 files" in summarize(tree.parent)


def test_a_validation_of_an_older_tree_does_not_count(tmp_path: Path) -> None:
    tree = build_tree(tmp_path)
    validate(tree, report=tree.with_name(f"{tree.name}.validation.json"), settings=SETTINGS)
    assert "NOT VALIDATED" not in summarize(tree.parent)
    with (tree / "SHA256SUMS").open("a") as sums:
        sums.write("\n")
    assert "NOT VALIDATED" in summarize(tree.parent)


def test_the_card_shows_a_split_that_can_be_loaded(tmp_path: Path) -> None:
    tree = build_tree(tmp_path, splits=["test", "unassigned", "unassigned"] * 2)
    assert 'load_dataset("card-germany", "frames", split="test")' in (tree / "README.md").read_text()


def test_a_tree_whose_last_sequence_left_is_valid_and_empty(tmp_path: Path) -> None:
    build_tree(tmp_path)
    tree = assemble_tree(tmp_path, [])
    assert find_problems(tree, load=True) == []
    assert not (tree / "data").exists()
    assert not (tree / "sequences").exists()


def test_a_missing_template_is_named(tmp_path: Path) -> None:
    terms = LICENSES["licenses"]["CC-BY-4.0"] | {"text": "absent.txt"}
    with pytest.raises(CardError, match=r"No such file or directory.*absent\.txt"):
        assemble_tree(tmp_path, [], terms=terms)


def test_summary_of_nothing(tmp_path: Path) -> None:
    assert summarize(tmp_path).startswith("nothing released yet")


def test_command_line(tree: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", str(tree)]) == 0
    assert main(["summary", str(tree.parent)]) == 0
    assert "1 sequences, 6 frames" in capsys.readouterr().out
    assert main(["validate", str(tmp_path / "nothing")]) == 1
    assert capsys.readouterr().err.startswith("card: ")
