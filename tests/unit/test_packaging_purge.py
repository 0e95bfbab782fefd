"""Copies of older versions, neighbours of a frame, and the steps on the Hub."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packaging_drive import FRAMES, SETTINGS, assemble_tree, sheet_row, write_drive, write_splits

from card.artifacts import read_table
from card.cli import main
from card.errors import CardError
from card.packaging.neighbours import neighbours
from card.packaging.pack import pack_sequence
from card.packaging.purge import purge
from card.packaging.reader import Release
from card.packaging.reader.extract import extract
from card.packaging.reader.verify import verify
from card.packaging.validate import find_problems
from card.privacy.regions import fill_regions

REGION = {"camera": "camera_left", "x_min": 0, "y_min": 0, "x_max": 16, "y_max": 16}


def entry(sequence: str, frames: Any, **more: Any) -> dict[str, Any]:
    return {"sequence": sequence, "frames": frames, "lidar": [], "region": None, "reason": "person",
            "date": "2026-05-01"} | more  # fmt: skip


TAKEDOWNS = [
    entry("de_one", [3, 3], lidar=["lidar_front"]),
    entry("de_one", [1, 1], region=REGION),
    entry("de_two", None),
]


@pytest.fixture(scope="module")
def versions(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A release of two sequences, and the next without a frame, a burst, a region and a sequence."""
    work = tmp_path_factory.mktemp("purge")
    items = []
    for seed, name in enumerate(("de_one", "de_two")):
        inputs = write_drive(work, sheet_row(name), seed)
        pack_sequence(**inputs)
        splits = write_splits(work / "results" / name / "splits.parquet", ["train"] * FRAMES)
        items.append({"id": name, "package": inputs["out"], "splits": splits})
        if seed == 0:
            first = inputs
    old = shutil.copytree(assemble_tree(work, items), work / "old" / "card-germany")
    own = TAKEDOWNS[:2]
    regions = work / "results" / "de_one" / "regions"
    fill_regions(anonymized=first["anonymized"], frames=first["frames"], takedowns=own, out=regions,
                 report=regions.with_suffix(".report.json"))  # fmt: skip
    pack_sequence(**first | {"takedowns": own, "regions": regions})
    new = assemble_tree(work, items[:1], takedowns=TAKEDOWNS, version="1.0.0", previous=old)
    return old, new


@pytest.fixture
def copy(versions: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(versions[0], tmp_path / "copy"))


def everything(folder: Path) -> bytes:
    return b"\0".join(path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file())


def test_a_purged_tree_holds_nothing_of_what_was_retracted(
    versions: tuple[Path, Path], copy: Path, tmp_path: Path
) -> None:
    old, new = map(Release, versions)
    gone = purge(copy, new)
    assert len(gone) == 4 + 1 + 1 + (4 + 5 * FRAMES)
    left = everything(copy)
    modalities = ("camera_left", "camera_right", "ground_truth", "lidar_front")
    retracted = [old.read("de_one", 3, name) for name in modalities]
    retracted += [old.read("de_one", 1, "camera_left")]
    retracted += [old.read("de_two", frame, "camera_left") for frame in range(FRAMES)]
    before = everything(versions[0])
    secrets = [
        next(part for at in range(0, len(content), 16) if before.count(part := content[at : at + 16]) == 1)
        for content in retracted
    ]
    assert not any(secret in left for secret in secrets)
    assert not (copy / "sequences" / "de_two").exists()
    redactions = copy / "sequences" / "de_one" / "redactions.parquet"
    assert 3 not in read_table(redactions, "redactions")["frame"].to_pylist()
    kept = Release(copy)
    for key, _ in kept.names():
        kept.read(key[0], key[2], key[1])
    assert verify(copy, tmp_path / "done") == []
    problems = [line for line in find_problems(copy) if not line.startswith(("README.md", "CITATION.cff"))]
    assert problems == []
    assert purge(copy, new) == []


def test_the_filled_image_of_the_current_version_stays(versions: tuple[Path, Path], tmp_path: Path) -> None:
    current = shutil.copytree(versions[1], tmp_path / "current")
    before = everything(current)
    assert purge(current, Release(versions[1])) == []
    assert everything(current) == before


def test_extracted_files_are_purged_too(versions: tuple[Path, Path], tmp_path: Path) -> None:
    extract(Release(versions[0]), tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    gone = purge(tmp_path, Release(versions[1]))
    assert "de_one/000003.lidar_front.laz" in gone
    assert "de_one/000001.camera_left.jpg" in gone
    assert len(gone) == 4 + 1 + 1 + (4 + 5 * FRAMES)
    assert len(list((tmp_path / "de_one").iterdir())) == 4 + 5 * FRAMES - 6
    assert (tmp_path / "notes.txt").is_file()


def test_neighbours_are_those_that_see_the_same_points(versions: tuple[Path, Path]) -> None:
    release = Release(versions[0])
    found = neighbours(release, "de_one", 2, SETTINGS | {"neighbour_s": 0, "neighbour_share": 0.9})
    same = [row for row in found if row["frame"] == 2]
    assert [row["why"] for row in same] == ["same moment"] * 2
    # The test drive goes 1.5 m a frame towards points 3 to 8 m ahead: the frames before see them all.
    points = release.points("de_one", 2)
    camera = release.rig("de_one").camera("camera_left")
    for row in found:
        if row["camera"] == "camera_left" and row["frame"] in (0, 1):
            there = release.transform("camera_left_from_world", "de_one", row["frame"]) @ release.transform(
                "world_from_camera_left", "de_one", 2
            )
            pixels = camera.project(points @ there[:3, :3].T + there[:3, 3])
            assert row["share"] == camera.contains(pixels).mean()
            low, high = np.rint(pixels.min(axis=0)), np.rint(pixels.max(axis=0)) + 1
            assert row["box"] == [*low, *high]
    assert {0, 1} <= {row["frame"] for row in found}
    assert 5 not in {row["frame"] for row in found}


def test_neighbours_in_time_are_listed_whatever_they_show(versions: tuple[Path, Path]) -> None:
    found = neighbours(
        Release(versions[0]), "de_one", 2, SETTINGS | {"neighbour_s": 0.1, "neighbour_share": 1.1}
    )
    assert {row["frame"] for row in found} == {1, 2, 3}
    assert {row["why"] for row in found} == {"time", "same moment"}


def test_a_region_follows_its_points(versions: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    release = Release(versions[0])
    camera = release.rig("de_one").camera("camera_left")
    u, v = camera.project(release.points("de_one", 2)[:1])[0]
    around = [int(u) - 3, int(v) - 3, int(u) + 4, int(v) + 4]
    settings = SETTINGS | {"neighbour_s": 0, "neighbour_share": 0.5}
    found = neighbours(release, "de_one", 2, settings, ("camera_left", around))
    assert next(row for row in found if row["why"] == "same moment")["camera"] == "camera_right"
    command = ["neighbours", str(versions[0]), "de_one", "2", "--region", *map(str, around)]
    assert main(command) == 0
    assert capsys.readouterr().out.startswith("frame\tcamera\twhy\tshare\tx_min")
    with pytest.raises(CardError, match=r"no such frame in the release \(found 99"):
        neighbours(release, "de_one", 99, SETTINGS)


def test_the_steps_name_the_objects_that_must_go(
    versions: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["history-steps", *map(str, versions), "owner/card-germany"]) == 0
    text = capsys.readouterr().out
    for line in (versions[0] / "SHA256SUMS").read_text().splitlines():
        sha, _, path = line.partition("  ")
        if path.startswith("data/de_two/"):
            assert f"`{sha}` " in text
        if path == "data/de_one/lidar_rear-000.tar":
            assert sha not in text
    assert "super_squash_history" in text
    assert main(["diff", *map(str, versions)]) == 0
    assert '"bump": "major"' in capsys.readouterr().out


def test_the_command_line_purges(
    versions: tuple[Path, Path], copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["purge", str(copy), str(versions[1])]) == 0
    assert f"files deleted from {copy}" in capsys.readouterr().out
