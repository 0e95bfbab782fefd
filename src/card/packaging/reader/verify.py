"""Check a download against its checksums, file by file, and name what is bad down to the single member."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

from card.artifacts import progress, read_table, sha256_file
from card.errors import CardError

SUMS, MEMBERS = "SHA256SUMS", "metadata/members.parquet"


def verify(tree: Path, done: Path, *, partial: bool = False) -> list[str]:
    """Lines on every file of `tree` that is damaged, missing or not listed; none for a good copy.

    Of a damaged shard the bad members are named, or that only bytes between members differ.

    Parameters
    ----------
    done : list of what was found good, beside the tree. A file on it is not read again while its size and
        time stay as they were, so a stopped check is taken up where it stopped.
    partial : a download of some files only: what is missing is no fault.
    """
    listed = read_sums(tree)
    good = _read_done(done)
    findings = []
    with done.open("a", encoding="utf-8") as notes:
        for path, sha256 in progress(sorted(listed.items()), f"verify {tree.name}"):
            file = tree / path
            if not file.is_file():
                findings += [] if partial else [f"{path}: missing"]
                continue
            state = file.stat()
            stamp = f"{state.st_size} {state.st_mtime_ns} {sha256}"
            if good.get(path) == stamp:
                continue
            if sha256_file(file) == sha256:
                notes.write(f"{stamp}  {path}\n")
                notes.flush()
            else:
                findings += _bad_parts(tree, path)
    present = {file.relative_to(tree).as_posix() for file in tree.rglob("*") if file.is_file()}
    return findings + [f"{path}: not of this release" for path in sorted(present - set(listed) - {SUMS})]


def read_sums(tree: Path) -> dict[str, str]:
    """SHA-256 by path from the tree's list of checksums; CardError without one."""
    try:
        lines = (tree / SUMS).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        raise CardError("no list of checksums", where=tree / SUMS) from None
    return {path: sha256 for sha256, _, path in (line.partition("  ") for line in lines)}


def _read_done(done: Path) -> dict[str, str]:
    if not done.is_file():
        return {}
    lines = done.read_text(encoding="utf-8").splitlines()
    return {path: stamp for stamp, _, path in (line.partition("  ") for line in lines)}


def _bad_parts(tree: Path, path: str) -> list[str]:
    if not path.endswith(".tar"):
        return [f"{path}: damaged"]
    bad = list(_bad_members(tree, path))
    return [f"{path}: damaged member {name}" for name in bad] or [f"{path}: damaged between its members"]


def _bad_members(tree: Path, shard: str) -> Iterator[str]:
    try:
        table = read_table(tree / MEMBERS, "release_members")
    except CardError:
        yield f"unknown, because {MEMBERS} is not readable"
        return
    with (tree / shard).open("rb") as file:
        for row in table.to_pylist():
            if row["shard"] == shard:
                file.seek(row["offset"])
                if hashlib.sha256(file.read(row["size"])).hexdigest() != row["sha256"]:
                    yield row["file"]
