"""Fingerprints of raw folders: content counts, times do not."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from card.errors import CardError
from card.recording import fingerprint as module
from card.recording.fingerprint import fingerprint


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    root = tmp_path / "raw"
    (root / "lidar").mkdir(parents=True)
    for name in ("a.txt", "b.txt", "lidar/c.laz"):
        (root / name).write_text(name)
        age(root / name)
    return root


def age(path: Path, seconds: float = 60.0) -> None:
    """Let a file look as if it was written some time ago."""
    then = time.time() - seconds
    os.utime(path, (then, then))


@pytest.fixture
def hashed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that were hashed."""
    names: list[str] = []
    original = module._sha256

    def spy(path: Path) -> str:
        names.append(path.name)
        return original(path)

    monkeypatch.setattr(module, "_sha256", spy)
    return names


def test_only_what_changed_is_hashed_again(folder: Path, tmp_path: Path, hashed: list[str]) -> None:
    cache = tmp_path / "cache" / "raw.json"
    first = fingerprint(folder, cache)
    assert sorted(hashed) == ["a.txt", "b.txt", "c.laz"]
    hashed.clear()
    assert fingerprint(folder, cache) == first
    assert hashed == []
    age(folder / "a.txt", 30.0)
    assert fingerprint(folder, cache) == first, "a touch changes nothing"
    assert hashed == ["a.txt"]
    hashed.clear()
    (folder / "b.txt").write_text("other")
    assert fingerprint(folder, cache) != first
    assert hashed == ["b.txt"]


def test_content_names_and_numbers_count(folder: Path, tmp_path: Path) -> None:
    seen = {fingerprint(folder, tmp_path / "cache.json")}

    def changes() -> None:
        before = len(seen)
        seen.add(fingerprint(folder, tmp_path / "cache.json"))
        assert len(seen) == before + 1

    (folder / "a.txt").write_text("A.txt")
    changes()
    (folder / "b.txt").rename(folder / "bb.txt")
    changes()
    (folder / "new.txt").write_text("")
    changes()
    (folder / "lidar" / "c.laz").unlink()
    changes()


def test_a_file_that_may_still_change_is_not_remembered(
    folder: Path, tmp_path: Path, hashed: list[str]
) -> None:
    cache = tmp_path / "cache.json"
    fresh = folder / "a.txt"
    fresh.write_text("now!!")
    stamp = fresh.stat().st_mtime_ns
    first = fingerprint(folder, cache)
    # Written again within the grain of the time stamp: size and time are the same.
    fresh.write_text("later")
    os.utime(fresh, ns=(stamp, stamp))
    assert fingerprint(folder, cache) != first


def test_one_file_and_nothing_at_all(folder: Path, tmp_path: Path) -> None:
    one = fingerprint(folder / "a.txt", tmp_path / "one.json")
    (folder / "a.txt").write_text("changed")
    assert fingerprint(folder / "a.txt", tmp_path / "one.json") != one
    nothing = fingerprint(folder / "none", tmp_path / "none.json")
    (tmp_path / "empty").mkdir()
    assert nothing == fingerprint(tmp_path / "empty", tmp_path / "empty.json") != one


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"a.txt": 5}', '{"a.txt": ["x", 1, "y"]}'])
def test_a_damaged_cache_is_as_good_as_none(folder: Path, tmp_path: Path, damage: str) -> None:
    cache = tmp_path / "cache.json"
    first = fingerprint(folder, cache)
    cache.write_text(damage)
    assert fingerprint(folder, cache) == first
    assert sorted(json.loads(cache.read_text())) == ["a.txt", "b.txt", "lidar/c.laz"]


def test_parsing_the_workflow_stays_light() -> None:
    heavy = "{'numpy', 'pyarrow', 'laspy', 'yaml'}"
    code = f"import sys, card.recording.fingerprint; print({heavy} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "set()"


def test_linked_folders_count_and_broken_links_are_named(folder: Path, tmp_path: Path) -> None:
    before = fingerprint(folder, tmp_path / "cache.json")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "label.txt").write_text("0")
    (folder / "labels").symlink_to(elsewhere)
    assert fingerprint(folder, tmp_path / "cache.json") != before
    (folder / "gone.laz").symlink_to(tmp_path / "nowhere")
    with pytest.raises(CardError, match=r"gone\.laz: link leads nowhere"):
        fingerprint(folder, tmp_path / "cache.json")
