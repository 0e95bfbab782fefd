"""What a tree holds, read once; what cannot be read is a finding and the checks that need it pass it by."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table
from card.errors import CardError
from card.packaging.reader import SPLITS

# Sidecars of a sequence; the first two stand for every one, the others as far as its modalities reach.
SIDECARS = {
    "provenance.json": "provenance",
    "quality.json": "quality",
    "calibration.json": "calibration",
    "poses.json": "poses",
    "wheel_excitation.json": "wheel_excitation",
    "road_planes.parquet": "road_planes",
    "imu.parquet": "imu",
    "redactions.parquet": "redactions",
}
ALWAYS = ("provenance.json", "quality.json")

Row = dict[str, Any]


@dataclass
class Contents:
    """Documents and rows of a release tree; `findings` are the lines of what could not be read."""

    tree: Path
    release: Row | None = None
    changes: Row | None = None
    croissant: Row | None = None
    frames: dict[str, list[Row]] = field(default_factory=dict)  # by split file
    sequences: list[Row] = field(default_factory=list)
    mini: list[Row] = field(default_factory=list)
    members: list[Row] = field(default_factory=list)
    retractions: list[Row] = field(default_factory=list)
    files: list[Row] = field(default_factory=list)
    sidecars: dict[str, dict[str, Any]] = field(default_factory=dict)  # by sequence and file name
    findings: list[str] = field(default_factory=list)

    def all_frames(self) -> list[Row]:
        return [row for rows in self.frames.values() for row in rows]

    def add(self, where: str, problem: str) -> None:
        self.findings.append(f"{where}: {problem}")


def read_contents(tree: Path) -> Contents:
    """Read every table and document of `tree` against its schema."""
    contents = Contents(tree)

    def attempt(read: Callable[[Path, str], Any], path: str, schema: str) -> Any:
        try:
            return read(tree / path, schema)
        except CardError as error:
            # Lines name paths in the tree, wherever it lies.
            contents.findings.append(str(error).replace(f"{tree}/", ""))
            return None

    def rows(path: str, schema: str) -> list[Row]:
        table = attempt(read_table, path, schema)
        return [] if table is None else table.to_pylist()

    contents.release = attempt(read_json, "release.json", "release")
    contents.changes = attempt(read_json, "changes.json", "changes")
    contents.croissant = attempt(read_json, "croissant.json", "croissant")
    contents.frames = {split: rows(f"metadata/frames-{split}.parquet", "release_frames") for split in SPLITS}
    contents.sequences = rows("metadata/sequences.parquet", "release_sequences")
    contents.members = rows("metadata/members.parquet", "release_members")
    contents.retractions = rows("metadata/retractions.parquet", "retractions")
    contents.files = rows("metadata/files.parquet", "release_files")
    contents.mini = rows("mini/mini.parquet", "release_mini")
    for row in contents.sequences:
        folder = f"sequences/{row['sequence']}"
        found = contents.sidecars.setdefault(row["sequence"], {})
        for name, schema in SIDECARS.items():
            if name in ALWAYS or (tree / folder / name).exists():
                read = read_json if name.endswith(".json") else read_table
                document = attempt(read, f"{folder}/{name}", schema)
                if document is not None:
                    found[name] = document
    return contents
