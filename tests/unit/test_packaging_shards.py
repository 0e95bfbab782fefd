"""Shards: plain, repeatable tars with an index of offsets."""

import hashlib
import os
import subprocess
import tarfile
from pathlib import Path

import pytest

from card.errors import CardError
from card.packaging.shards import Source, write_shards

LARGE = {"max_bytes": 10**6, "numbers": 100}


def sources(count: int = 5, size: int = 700) -> list[Source]:
    return [Source(f"a/{n:06d}.labels.txt", n, bytes([n]) * size) for n in range(count)]


def test_offsets_point_at_the_content(tmp_path: Path) -> None:
    members = write_shards(sources(), tmp_path, "labels", **LARGE)
    for number, member in enumerate(members):
        with (tmp_path / member.shard).open("rb") as file:
            file.seek(member.offset)
            content = file.read(member.size)
        assert content == bytes([number]) * 700
        assert hashlib.sha256(content).hexdigest() == member.sha256


def test_other_tar_readers_agree(tmp_path: Path) -> None:
    members = write_shards(sources(), tmp_path, "labels", **LARGE)
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
            files.append(Source(source.name, source.number, path))
        write_shards(files, folder, "labels", **LARGE)
    one, two = (tmp_path / name / "labels-000.tar" for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()


def test_a_part_holds_a_range_of_numbers(tmp_path: Path) -> None:
    members = write_shards(sources(9), tmp_path, "labels", max_bytes=10**6, numbers=4)
    assert [member.shard for member in members] == [f"labels-00{n // 4}.tar" for n in range(9)]


def test_ranges_are_halved_until_parts_stay_within_their_limit(tmp_path: Path) -> None:
    members = write_shards(sources(9), tmp_path, "labels", max_bytes=6000, numbers=8)
    parts = sorted(path.name for path in tmp_path.iterdir())
    assert parts == ["labels-000.tar", "labels-001.tar", "labels-002.tar", "labels-003.tar", "labels-004.tar"]
    assert all((tmp_path / part).stat().st_size <= 6000 for part in parts)
    assert [member.shard for member in members] == [parts[n // 2] for n in range(9)]


def test_a_removed_source_rewrites_its_own_part_only(tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.mkdir()
    new.mkdir()
    stated = [
        Source(s.name, s.number, s.content, hashlib.sha256(bytes(s.content)).hexdigest()) for s in sources(9)
    ]  # type: ignore[arg-type]
    write_shards(stated, old, "labels", max_bytes=10**6, numbers=4)
    members = write_shards(stated[:5] + stated[6:], new, "labels", max_bytes=10**6, numbers=4, previous=old)
    linked = [
        (old / p).stat().st_ino == (new / p).stat().st_ino
        for p in sorted(path.name for path in new.iterdir())
    ]
    assert linked == [True, False, True]
    fresh = tmp_path / "fresh"
    fresh.mkdir()
    assert write_shards(stated[:5] + stated[6:], fresh, "labels", max_bytes=10**6, numbers=4) == members
    for path in fresh.iterdir():
        assert path.read_bytes() == (new / path.name).read_bytes()


@pytest.mark.parametrize("at", [10, 600, 1100, 1300, -5])
def test_a_damaged_old_shard_is_not_taken_over(tmp_path: Path, at: int) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.mkdir()
    new.mkdir()
    stated = [
        Source(s.name, s.number, s.content, hashlib.sha256(bytes(s.content)).hexdigest()) for s in sources()
    ]  # type: ignore[arg-type]
    write_shards(stated, old, "labels", **LARGE)
    path = old / "labels-000.tar"
    good = path.read_bytes()
    damaged = bytearray(good)
    damaged[at] ^= 1
    path.write_bytes(damaged)
    write_shards(stated, new, "labels", **LARGE, previous=old)
    assert (new / "labels-000.tar").read_bytes() == good


def test_no_sources_make_no_shard(tmp_path: Path) -> None:
    assert write_shards([], tmp_path, "labels", **LARGE) == []
    assert list(tmp_path.iterdir()) == []


def test_a_file_larger_than_a_shard_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"larger than a shard.*found 9000 bytes"):
        write_shards(sources(1, 9000), tmp_path, "labels", max_bytes=6000, numbers=100)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"gone\.jpg: file is missing"):
        write_shards(
            [Source("a/000000.camera_left.jpg", 0, tmp_path / "gone.jpg")], tmp_path, "camera_left", **LARGE
        )


def test_content_must_have_its_stated_hash(tmp_path: Path) -> None:
    with pytest.raises(CardError, match="differs from what its stage recorded"):
        write_shards([Source("a/000000.labels.txt", 0, b"x", "0" * 64)], tmp_path, "labels", **LARGE)
