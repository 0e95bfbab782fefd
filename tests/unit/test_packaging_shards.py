"""Shards: plain, repeatable tars with an index of offsets."""

import hashlib
import os
import subprocess
import tarfile
from pathlib import Path

import pytest

from card.errors import CardError
from card.packaging.shards import Source, write_shards


def sources(count: int = 5, size: int = 700) -> list[Source]:
    return [Source(f"a/{n:06d}.labels.txt", bytes([n]) * size) for n in range(count)]


def test_offsets_point_at_the_content(tmp_path: Path) -> None:
    members = write_shards(sources(), tmp_path, "labels", 10**6)
    for number, member in enumerate(members):
        with (tmp_path / member.shard).open("rb") as file:
            file.seek(member.offset)
            content = file.read(member.size)
        assert content == bytes([number]) * 700
        assert hashlib.sha256(content).hexdigest() == member.sha256


def test_other_tar_readers_agree(tmp_path: Path) -> None:
    members = write_shards(sources(), tmp_path, "labels", 10**6)
    with tarfile.open(tmp_path / "labels-000.tar", "r:") as tar:
        infos = tar.getmembers()
    assert [(info.name, info.offset_data, info.size) for info in infos] == [
        (member.name, member.offset, member.size) for member in members
    ]
    assert {(info.mtime, info.uid, info.gid, info.uname, info.gname) for info in infos} == {(0, 0, 0, "", "")}
    listing = subprocess.run(
        ["tar", "-tf", tmp_path / "labels-000.tar"], capture_output=True, check=True, text=True
    )
    assert listing.stdout.split() == [member.name for member in members]
    assert listing.stderr == ""


def test_order_and_time_of_the_sources_do_not_matter(tmp_path: Path) -> None:
    for name, order in (("one", 1), ("two", -1)):
        folder = tmp_path / name
        folder.mkdir()
        files = []
        for source in sources()[::order]:
            path = folder / source.name.replace("/", "_")
            assert isinstance(source.content, bytes)
            path.write_bytes(source.content)
            os.utime(path, (len(files), len(files)))
            files.append(Source(source.name, path))
        write_shards(files, folder, "labels", 10**6)
    one, two = (tmp_path / name / "labels-000.tar" for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()


def test_parts_stay_within_their_limit(tmp_path: Path) -> None:
    members = write_shards(sources(9), tmp_path, "labels", 6000)
    parts = sorted(path.name for path in tmp_path.iterdir())
    assert parts == ["labels-000.tar", "labels-001.tar", "labels-002.tar"]
    assert all((tmp_path / part).stat().st_size <= 6000 for part in parts)
    assert [member.shard for member in members] == [part for part in parts for _ in range(3)]


def test_no_sources_make_no_shard(tmp_path: Path) -> None:
    assert write_shards([], tmp_path, "labels", 10**6) == []
    assert list(tmp_path.iterdir()) == []


def test_a_file_larger_than_a_shard_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"larger than a shard.*found 9000 bytes"):
        write_shards(sources(1, 9000), tmp_path, "labels", 6000)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"gone\.jpg: file is missing"):
        write_shards(
            [Source("a/000000.camera_left.jpg", tmp_path / "gone.jpg")], tmp_path, "camera_left", 10**6
        )


def test_content_must_have_its_stated_hash(tmp_path: Path) -> None:
    with pytest.raises(CardError, match="differs from what its stage recorded"):
        write_shards([Source("a/000000.labels.txt", b"x", "0" * 64)], tmp_path, "labels", 10**6)
