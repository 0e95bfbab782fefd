"""The firewall between licences: nothing of one tree, nor made from it, is in a tree of another licence."""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table, write_report
from card.errors import CardError

SHARED = ("calibration", "labels", "label_states")
"""Sources that drives of two licences may have in common: a session is of no place, labels may be none."""
TEXT = (".md", ".json", ".cff", ".txt", "NOTICE", "LICENSE", "SHA256SUMS")
SMALL = 64
"""Files below this size, bytes, may be alike by chance, as empty label files are."""


@dataclass(frozen=True)
class Tree:
    """What a tree holds: hashes of contents and of what they were made from, each with a name for it."""

    path: Path
    spdx: str
    countries: Mapping[str, str]
    contents: Mapping[str, str]
    sources: Mapping[str, str]


def check_firewall(trees: Sequence[Path], countries: Mapping[str, str], report: Path | None = None) -> None:
    """CardError with the first breach between the `trees`; each may have any licence.

    By place: the licence of each sequence's country, as `countries` gives it, is its tree's. By provenance:
    no two licences share a file, a thumbnail or the artifact that one was made from. By name: no file and
    no table of a tree names a sequence of another licence.
    """
    read = [_read(path) for path in trees]
    findings = [line for tree in read for line in _by_place(tree, countries)]
    for tree in read:
        others = [other for other in read if other.spdx != tree.spdx]
        findings += [line for other in others for line in _by_provenance(tree, other)]
        strangers = {name for other in others for name in other.countries} - set(tree.countries)
        findings += _by_name(tree, strangers)
    if findings:
        more = f" and {len(findings) - 1} more" if len(findings) > 1 else ""
        raise CardError(f"licences are mixed: {findings[0]}{more}")
    if report is not None:
        write_report(
            report,
            stage="firewall",
            settings={"countries": dict(countries)},
            inputs={tree.path.name: tree.path / "SHA256SUMS" for tree in read},
            counts={"trees": len(read), "contents": sum(len(tree.contents) for tree in read)},
        )


def _read(path: Path) -> Tree:
    members = read_table(path / "metadata/members.parquet", "release_members").to_pylist()
    contents = {
        row["sha256"]: row["file"] for row in members if row["size"] >= SMALL and row["modality"] != "labels"
    }
    for row in read_table(path / "mini/mini.parquet", "release_mini").to_pylist():
        contents[hashlib.sha256(row["image"]).hexdigest()] = f"thumbnail of {row['sequence']} {row['frame']}"
    sources: dict[str, str] = {}
    for file in sorted(path.glob("sequences/*/provenance.json")):
        document = read_json(file, "provenance")
        sources |= {
            sha: f"{name} of {document['sequence']}"
            for name, sha in document["sources"].items()
            if name not in SHARED
        }
    rows = read_table(path / "metadata/sequences.parquet", "release_sequences").to_pylist()
    return Tree(
        path,
        read_json(path / "release.json", "release")["spdx"],
        {row["sequence"]: row["country"] for row in rows},
        contents,
        sources,
    )


def _by_place(tree: Tree, countries: Mapping[str, str]) -> Iterator[str]:
    for sequence, country in sorted(tree.countries.items()):
        if countries.get(country) != tree.spdx:
            licence = countries.get(country, "no licence")
            yield f"{sequence} is from {country}, under {licence}, but in {tree.path.name} under {tree.spdx}"


def _by_provenance(tree: Tree, other: Tree) -> Iterator[str]:
    for kind in ("contents", "sources"):
        mine, theirs = getattr(tree, kind), getattr(other, kind)
        for sha in sorted(mine.keys() & theirs.keys()):
            yield f"{mine[sha]} in {tree.path.name} is {theirs[sha]} in {other.path.name}"


def _by_name(tree: Tree, strangers: set[str]) -> Iterator[str]:
    if not strangers:
        return
    names = sorted(map(re.escape, strangers), key=len, reverse=True)
    pattern = re.compile(rf"(?<![a-z0-9_-])({'|'.join(names)})(?![a-z0-9_-])")
    for path in sorted(path for path in tree.path.rglob("*") if path.is_file()):
        text = path.relative_to(tree.path).as_posix()
        if path.name.endswith(TEXT):
            text += "\n" + path.read_text(encoding="utf-8", errors="replace")
        elif path.suffix == ".parquet":
            text = "\n".join((text, *_strings(path)))
        if match := pattern.search(text):
            yield f"{path.relative_to(tree.path)} in {tree.path.name} names {match[1]}"


def _strings(path: Path) -> Iterator[str]:
    """All different texts in a table."""
    import pyarrow.parquet as pq
    import pyarrow.types as types

    table: Any = pq.read_table(path, partitioning=None)
    for column in table.columns:
        if types.is_string(column.type):
            yield from (text for text in column.unique().to_pylist() if text is not None)
