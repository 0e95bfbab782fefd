"""What the release holds altogether and by licence, as HTML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table
from card.report.numbers import distance, duration, number, size

SPLITS = ("train", "validation", "test", "zero_shot", "unassigned")


@dataclass(frozen=True)
class Tree:
    """One release tree: its document `release` and its rows of `release_sequences`."""

    document: Mapping[str, Any]
    sequences: Sequence[Mapping[str, Any]]

    @property
    def frames(self) -> int:
        """Frames of all splits."""
        return sum(self.document["frames"].values())

    @property
    def metres(self) -> float:
        """Length of all tracks that are known, m."""
        return sum(row["distance_m"] or 0.0 for row in self.sequences)

    @property
    def seconds(self) -> float:
        """Duration of all sequences, s."""
        return sum(row["t_end_ns"] - row["t_start_ns"] for row in self.sequences) / 1e9


def read_tree(path: Path) -> Tree:
    """The totals of a release tree."""
    sequences = read_table(path / "metadata" / "sequences.parquet", "release_sequences").to_pylist()
    return Tree(read_json(path / "release.json", "release"), sequences)


def tiles(trees: Sequence[Tree]) -> str:
    """The release in six numbers."""
    numbers = {
        "sequences": number(sum(len(tree.sequences) for tree in trees)),
        "frames": number(sum(tree.frames for tree in trees)),
        "driven": distance(sum(tree.metres for tree in trees)),
        "recorded": duration(sum(tree.seconds for tree in trees)),
        "files": number(sum(tree.document["files"] for tree in trees)),
        "in shards": size(sum(tree.document["bytes"] for tree in trees)),
    }
    return "".join(f"<div><b>{value}</b><span>{name}</span></div>" for name, value in numbers.items())


def license_table(trees: Sequence[Tree]) -> str:
    """One row a tree: what it holds under which licence, and its frames by split."""
    head = ["tree", "version", "licence", "sequences", *(split.replace("_", "-") for split in SPLITS)]
    head += ["driven", "files", "size"]
    lines = []
    for tree in trees:
        about = tree.document
        terms = about["spdx"] if about["commercial"] else f"{about['spdx']}, non-commercial"
        names = [about["repository"], about["version"], terms]
        counts = [len(tree.sequences), *(about["frames"][split] for split in SPLITS)]
        sums = [distance(tree.metres), number(about["files"]), size(about["bytes"])]
        lines.append(
            "<tr>"
            + "".join(f"<td>{escape(str(name))}</td>" for name in names)
            + "".join(f'<td class="n">{cell}</td>' for cell in [*map(number, counts), *sums])
            + "</tr>"
        )
    cells = [f'<th class="{"n" if index > 2 else ""}">{name}</th>' for index, name in enumerate(head)]
    return f"<table><thead><tr>{''.join(cells)}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
