"""Packages of one licence in their places in a tree."""

import os
import shutil
from pathlib import Path

from card.artifacts import read_json, read_table
from card.errors import CardError


def check_license(sequence: str, package: Path, spdx: str) -> None:
    """The firewall: every statement of a licence in the package must name the tree's."""
    stated = {
        "sequence.json": {read_json(package / "sequence.json", "release_sequence")["spdx"]},
        "provenance.json": {read_json(package / "sidecars" / "provenance.json", "provenance")["spdx"]},
        "members.parquet": set(
            read_table(package / "members.parquet", "release_members")["spdx"].to_pylist()
        ),
        "frames.parquet": set(read_table(package / "frames.parquet", "package_frames")["spdx"].to_pylist()),
    }
    for name, found in stated.items():
        if found - {spdx}:
            raise CardError(
                "file under another licence than the tree",
                where=f"sequence {sequence}, {name}",
                found=", ".join(sorted(found - {spdx})),
                wanted=spdx,
            )


def place(sequence: str, package: Path, tree: Path) -> dict[str, str]:
    """Link (or copy) a package's shards and sidecars into the tree; return their recorded hashes."""
    listed = read_table(package / "inventory.parquet", "inventory").to_pydict()
    hashes = {}
    for name, sha256 in zip(listed["name"], listed["sha256"], strict=True):
        folder, _, rest = name.partition("/")
        if folder not in ("data", "sidecars"):
            continue
        path = f"{'data' if folder == 'data' else 'sequences'}/{sequence}/{rest}"
        target = tree / path
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(package / name, target)
        except OSError:  # another file system, or one without hard links
            shutil.copyfile(package / name, target)
        hashes[path] = sha256
    return hashes
