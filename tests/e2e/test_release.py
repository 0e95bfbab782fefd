"""The whole chain on the embedded drives at the tiny scale."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from project import Project, copy_repository

TREES = ("card-germany", "card-italy")


def sums(project: Project) -> dict[str, str]:
    return {name: (project.root / "results" / "release" / name / "SHA256SUMS").read_text() for name in TREES}


def load(tree: Path, config: str, cache: Path) -> dict[str, int]:
    """Rows a split, as the datasets library of a user sees them, in a process of its own."""
    program = (
        "import json, sys, datasets;"
        "loaded = datasets.load_dataset(sys.argv[1], sys.argv[2]);"
        "print(json.dumps({name: len(split) for name, split in loaded.items()}))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program, str(tree), config],
        env={**os.environ, "HF_HUB_OFFLINE": "1", "HF_HOME": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr[-3000:]
    rows: dict[str, int] = json.loads(result.stdout.splitlines()[-1])
    return rows


@pytest.mark.parametrize("name", TREES)
def test_the_tree_loads_with_datasets(built: Project, tmp_path: Path, name: str) -> None:
    tree = built.root / "results" / "release" / name
    release = json.loads((tree / "release.json").read_text())
    frames = load(tree, "frames", tmp_path)
    # The library cannot load a split without rows; the card lists those that have some.
    assert frames == {split: rows for split, rows in release["frames"].items() if rows}
    for split in ("train", "validation", "test", "zero_shot", "unassigned"):
        assert (tree / "metadata" / f"frames-{split}.parquet").is_file()
    assert sum(load(tree, "sequences", tmp_path).values()) == len(release["sequences"])


def test_no_raw_image_is_in_a_tree(built: Project) -> None:
    from card.packaging.reader import Release

    compared = 0
    for name in TREES:
        release = Release(built.root / "results" / "release" / name)
        for row in release.frames():
            id = row["sequence"]
            images = json.loads((built.root / "results" / id / "privacy.report.json").read_text())["counts"]
            assert images["images"] > 0
            raw_folder = built.root / "recordings" / id
            raw = raw_folder / "camera_left" / f"{row['t_ns']}.jpg"
            if raw.is_file():
                published = release.read(id, row["frame"], "camera_left")
                anonymized = built.root / "results" / id / "anonymized" / "camera_left" / raw.name
                assert published == anonymized.read_bytes()
                compared += 1
    assert compared > 0


def test_another_folder_gives_the_same_bytes(built: Project, tmp_path: Path) -> None:
    other = copy_repository(tmp_path, "tiny")
    other.build("release")
    assert sums(other) == sums(built)


def test_new_sequences_get_their_splits_on_demand(built: Project) -> None:
    ledger = built.root / "config" / "ledger" / "splits.tsv"
    before = ledger.read_text()
    header, first, *others = before.splitlines(keepends=True)
    try:
        ledger.write_text(header + first)
        built.build("assign_splits")
        after = ledger.read_text()
        assert after.startswith(header + first)
        assert {line.split("\t")[0] for line in after.splitlines()[2:]} == {x.split("\t")[0] for x in others}
    finally:
        ledger.write_text(before)


def test_a_bad_sequence_fails_alone_and_quarantine_releases_the_rest(built: Project) -> None:
    before = sums(built)
    sweep = sorted((built.root / "recordings" / "de_town_bumps" / "lidar_front").iterdir())[2]
    content = sweep.read_bytes()
    sweep.write_bytes(content[:100])
    line = next(
        line
        for line in (built.root / "config" / "sequences.tsv").read_text().splitlines(keepends=True)
        if line.startswith("de_town_bumps\t")
    )
    try:
        result = built.run("release")
        assert result.returncode != 0
        assert f"{sweep.name}" in result.stdout
        assert sums(built) == before
        with built.changed("config/sequences.tsv", line, line.replace("\t-\n", "\tbroken sweep\n")):
            built.build("release")
            german = json.loads((built.root / "results/release/card-germany/release.json").read_text())
            assert german["sequences"] == ["de_gravel_offroad", "de_rural_potholes"]
            assert not (built.root / "results/release/card-germany/data/de_town_bumps").exists()
    finally:
        sweep.write_bytes(content)
    built.build("release")
    assert sums(built) == before
