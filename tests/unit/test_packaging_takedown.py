"""A takedown removes every byte of what it names, touches little else and leaves a tombstone."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from packaging_drive import FRAMES, assemble_tree, sheet_row, write_drive, write_splits

from card.artifacts import inventory, load_schema, read_json, read_table
from card.errors import CardError
from card.packaging.pack import pack_sequence
from card.packaging.reader import Release
from card.packaging.takedowns import read_takedowns
from card.packaging.validate import find_problems
from card.privacy.regions import fill_regions

MODALITIES = ("camera_left", "camera_right", "ground_truth", "labels")


def entry(frames: Any, **more: Any) -> dict[str, Any]:
    return {"sequence": "de_test", "frames": frames, "lidar": [], "region": None, "reason": "person",
            "date": "2026-05-01"} | more  # fmt: skip


def thumbnail(tree: Path, frame: int) -> bytes:
    rows = read_table(tree / "mini" / "mini.parquet", "release_mini").to_pylist()
    image: bytes = next(row["image"] for row in rows if row["frame"] == frame)
    return image


class Project:
    """A drive with three frames a shard that can be released again and again."""

    def __init__(self, work: Path) -> None:
        self.work = work
        self.inputs = write_drive(work, sheet_row())
        self.inputs["settings"] |= {"shard_frames": 3}
        self.splits = write_splits(work / "splits.parquet", ["train"] * FRAMES)

    def release(self, takedowns: list[Any], version: str = "0.1.0", previous: Path | None = None) -> Path:
        pack_sequence(**self.inputs | {"takedowns": takedowns})
        item = {"id": "de_test", "package": self.inputs["out"], "splits": self.splits}
        return assemble_tree(self.work, [item], takedowns=takedowns, version=version, previous=previous)

    def keep(self, tree: Path, name: str) -> Path:
        return Path(shutil.copytree(tree, self.work / name))


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path)


def pieces(content: bytes, length: int = 16) -> list[bytes]:
    """Short parts of a file that nothing else holds by chance: not of one byte, not from a common header."""
    parts = [content[at : at + length] for at in range(len(content) // 3, len(content) - length, length)]
    return [part for part in parts if len(set(part)) > 8] or [content]


def everything(tree: Path) -> list[bytes]:
    """All bytes of a tree: its files, and the cells of its compressed tables."""
    found = [path.read_bytes() for path in tree.rglob("*") if path.is_file()]
    for path in tree.rglob("*.parquet"):
        for column in pq.read_table(path).columns:
            found += [cell if isinstance(cell, bytes) else repr(cell).encode() for cell in column.to_pylist()]
    return found


def test_nothing_of_a_frame_remains_in_any_byte(project: Project) -> None:
    before = project.keep(project.release([]), "before")
    release = Release(before)
    contents = {modality: release.read("de_test", 3, modality) for modality in MODALITIES}
    points = release.points("de_test", 3).tobytes()
    others = [release.read(key[0], key[2], key[1]) for key, _ in release.names() if key[2] not in (3, 4)]
    secrets = [release.sha256("de_test", 3, modality).encode() for modality in MODALITIES]
    for content in (*contents.values(), points, thumbnail(before, 4)):
        own = [piece for piece in pieces(content) if not any(piece in other for other in others)]
        assert own
        secrets += own
    there = everything(before)
    hidden = set(pieces(points))  # compressed in its npz
    assert all(any(secret in content for content in there) for secret in secrets if secret not in hidden)

    tree = project.release([entry([3, 4])], "1.0.0", before)
    assert find_problems(tree) == []
    left = everything(tree)
    assert [secret for secret in secrets if any(secret in content for content in left)] == []
    assert not {3, 4} & {row["frame"] for row in Release(tree).frames()}
    # LiDAR stays unless it is named.
    assert Release(tree).read("de_test", 3, "lidar_front") == release.read("de_test", 3, "lidar_front")


def test_a_named_lidar_goes_too(project: Project) -> None:
    before = project.keep(project.release([]), "before")
    tree = project.release([entry([3, 4], lidar=["lidar_rear"])], "1.0.0", before)
    release = Release(tree)
    names = {key for key, _ in release.names()}
    assert ("de_test", "lidar_rear", 3) not in names
    assert ("de_test", "lidar_rear", 4) not in names
    assert ("de_test", "lidar_front", 3) in names
    assert find_problems(tree) == []


def test_only_the_shards_of_the_frame_are_written_again(project: Project) -> None:
    tree = project.release([])
    before = {path.name: path.stat().st_ino for path in (tree / "data" / "de_test").iterdir()}
    inodes = dict(before)
    kept = project.keep(tree, "before")
    tree = project.release([entry([4, 4])], "1.0.0", kept)
    after = {path.name: path.stat().st_ino for path in (tree / "data" / "de_test").iterdir()}
    assert after.keys() == before.keys()
    rewritten = {name for name in after if after[name] != inodes[name]}
    assert rewritten == {f"{modality}-001.tar" for modality in MODALITIES}
    for path in (tree / "sequences").rglob("*"):
        assert (
            path.is_dir()
            or path.name in ("provenance.json", "redactions.parquet")
            or path.read_bytes() == (kept / path.relative_to(tree)).read_bytes()
        )
    left = read_table(tree / "sequences/de_test/redactions.parquet", "redactions")["frame"].to_pylist()
    assert left == [frame for frame in range(FRAMES) if frame != 4]


def test_tombstones_tell_what_and_why_but_not_who(project: Project) -> None:
    before = project.keep(project.release([]), "before")
    tree = project.release([entry([3, 3])], "1.0.0", before)
    rows = read_table(tree / "metadata/retractions.parquet", "retractions").to_pylist()
    assert {row["modality"] for row in rows} == set(MODALITIES)
    assert {(row["frame"], row["reason"], row["version"], row["date"]) for row in rows} == {
        (3, "person", "1.0.0", "2026-05-01")
    }
    assert set(load_schema("retractions")["columns"]) == {
        "sequence", "modality", "frame", "burst", "region", "reason", "date", "version",
    }  # fmt: skip
    # A later release keeps the version that was the first without.
    kept = project.keep(tree, "1.0.0")
    later = project.release([entry([3, 3]), entry([5, 5], date="2026-06-01")], "2.0.0", kept)
    rows = read_table(later / "metadata/retractions.parquet", "retractions").to_pylist()
    assert {(row["frame"], row["version"]) for row in rows} == {(3, "1.0.0"), (5, "2.0.0")}


def test_what_was_taken_down_stays_down(project: Project) -> None:
    before = project.keep(project.release([entry([3, 3])]), "before")
    with pytest.raises(CardError, match=r"takedown of an earlier release is missing .*de_test, .*, 3"):
        project.release([], "1.0.0", before)


def test_a_sequence_goes_whole(project: Project) -> None:
    before = project.keep(project.release([]), "before")
    tree = assemble_tree(
        project.work, [], takedowns=[entry(None, reason="consent")], version="1.0.0", previous=before
    )
    assert find_problems(tree) == []
    (row,) = read_table(tree / "metadata/retractions.parquet", "retractions").to_pylist()
    assert (row["sequence"], row["modality"], row["reason"]) == ("de_test", None, "consent")
    changes = read_json(tree / "changes.json", "changes")
    assert (changes["bump"], changes["sequences"]["removed"]) == ("major", ["de_test"])
    secrets = [
        piece
        for key, _ in Release(before).names()
        for piece in pieces(Release(before).read(key[0], key[2], key[1]))[:3]
    ]
    assert not any(secret in content for secret in secrets if len(secret) > 8 for content in everything(tree))
    with pytest.raises(CardError, match="retracted, but packed all the same"):
        item = {"id": "de_test", "package": project.inputs["out"], "splits": project.splits}
        assemble_tree(project.work, [item], takedowns=[entry(None)], version="2.0.0", previous=before)


def test_a_region_is_filled_and_the_rest_of_the_image_stays(project: Project) -> None:
    before = project.keep(project.release([]), "before")
    region = {"camera": "camera_right", "x_min": 16, "y_min": 0, "x_max": 30, "y_max": 16}
    takedowns = [entry([2, 3], region=region)]
    folder = project.work / "results" / "de_test" / "regions"
    fill_regions(
        anonymized=project.inputs["anonymized"],
        frames=project.inputs["frames"],
        takedowns=takedowns,
        out=folder,
        report=folder.with_suffix(".report.json"),
    )
    assert len(inventory(folder)["name"]) == 2 + 2  # two images, images.parquet, inventory
    with pytest.raises(CardError, match="frame 2, camera_right: region that was taken down is not filled"):
        project.release(takedowns, "1.0.0", before)
    project.inputs["regions"] = folder
    tree = project.release(takedowns, "1.0.0", before)
    assert find_problems(tree) == []
    old, new = Release(before), Release(tree)
    for frame in (2, 3):
        image, was = new.image("de_test", frame, "camera_right"), old.image("de_test", frame, "camera_right")
        # Next to the fill the decoder mixes the chroma of neighbours.
        assert (np.abs(image[2:14, 18:30].astype(int) - 128) <= 1).all()
        assert np.abs(was[2:14, 18:30].astype(int) - 128).mean() > 10
        np.testing.assert_array_equal(image[16:, :15], was[16:, :15])
        assert new.read("de_test", frame, "camera_left") == old.read("de_test", frame, "camera_left")
        left = everything(tree)
        hidden = pieces(old.read("de_test", frame, "camera_right"), 24)
        assert sum(any(piece in content for content in left) for piece in hidden) < len(hidden)
        assert not any(old.sha256("de_test", frame, "camera_right").encode() in content for content in left)
    rows = read_table(tree / "metadata/retractions.parquet", "retractions").to_pylist()
    assert [(row["frame"], row["modality"], row["region"]) for row in rows] == [
        (2, "camera_right", True), (3, "camera_right", True),
    ]  # fmt: skip
    changes = read_json(tree / "changes.json", "changes")
    assert changes["files"]["edited"] == [f"de_test/00000{n}.camera_right.jpg" for n in (2, 3)]


def test_a_region_outside_the_image_is_refused(project: Project) -> None:
    region = {"camera": "camera_left", "x_min": 0, "y_min": 0, "x_max": 33, "y_max": 8}
    with pytest.raises(CardError, match=r"region outside the image \(found 33, 8, wanted at most 32, 24"):
        fill_regions(
            anonymized=project.inputs["anonymized"],
            frames=project.inputs["frames"],
            takedowns=[entry([0, 0], region=region)],
            out=project.work / "regions",
            report=project.work / "regions.report.json",
        )
    assert not (project.work / "regions").exists()


def test_a_takedown_of_no_frame_is_an_error(project: Project) -> None:
    with pytest.raises(CardError, match=r"frames that the sequence does not have \(found 60..61"):
        project.release([entry([60, 61])])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{sequence: de_gone, frames: 3, reason: person, date: 2026-05-01}", "unknown sequence"),
        ("{sequence: de_test, frames: [4, 3], reason: person, date: 2026-05-01}", "ends before it starts"),
        ("{sequence: de_test, frames: 3, reason: Mrs Smith asked, date: 2026-05-01}", "reason"),
        ("{sequence: de_test, frames: 3, reason: person, date: 2026-05-01, name: Smith}", "name"),
        (
            "{sequence: de_test, reason: person, date: 2026-05-01, "
            "region: {camera: camera_left, x_min: 0, y_min: 0, x_max: 8, y_max: 8}}",
            "region without a frame",
        ),
        (
            "{sequence: de_test, frames: 3, reason: person, date: 2026-05-01, "
            "region: {camera: camera_left, x_min: 8, y_min: 0, x_max: 8, y_max: 8}}",
            "region is empty",
        ),
    ],
)
def test_bad_entries_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "takedowns.yaml"
    path.write_text(f"takedowns:\n  - {text}\n")
    with pytest.raises(CardError, match=message):
        read_takedowns(path, ["de_test"])


def test_entries_are_read_in_one_form(tmp_path: Path) -> None:
    path = tmp_path / "takedowns.yaml"
    path.write_text(
        "takedowns:\n  - {sequence: de_test, frames: 3, reason: person, date: 2026-05-01}\n"
        "  - {sequence: de_test, reason: legal, date: 2026-05-02, frames: [1, 2], lidar: [lidar_rear]}\n"
    )
    assert read_takedowns(path, ["de_test"]) == [
        entry([3, 3]),
        entry([1, 2], reason="legal", date="2026-05-02", lidar=["lidar_rear"]),
    ]
