"""Faults to seed into a release tree."""

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from card.artifacts import sha256_file

MEMBERS = "metadata/members.parquet"
Corruption = Callable[[Path], None]


def seal(tree: Path) -> None:
    """Make all checksums fit again, so that only the fault itself can be found."""
    path = tree / "croissant.json"
    if path.exists():
        document = json.loads(path.read_text())
        for file in document["distribution"]:
            if (tree / file["@id"]).exists():
                file["sha256"] = sha256_file(tree / file["@id"])
        path.write_text(json.dumps(document))
    files = sorted(path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file())
    sums = [f"{sha256_file(tree / name)}  {name}\n" for name in files if name != "SHA256SUMS"]
    (tree / "SHA256SUMS").write_text("".join(sums))


def cell(path: str, column: str, row: int, value: Any) -> Corruption:
    """Change one cell of a table."""

    def corrupt(tree: Path) -> None:
        table = pq.read_table(tree / path)
        values = table[column].to_pylist()
        values[row] = value
        index = table.column_names.index(column)
        pq.write_table(table.set_column(index, column, pa.array(values, table[column].type)), tree / path)

    return corrupt


def rows(path: str, change: Callable[[list[Any]], list[Any]]) -> Corruption:
    """Change the list of rows of a table."""

    def corrupt(tree: Path) -> None:
        table = pq.read_table(tree / path)
        pq.write_table(pa.Table.from_pylist(change(table.to_pylist()), table.schema), tree / path)

    return corrupt


def field(path: str, *keys: Any, value: Any) -> Corruption:
    """Change one field of a JSON document."""

    def corrupt(tree: Path) -> None:
        document = json.loads((tree / path).read_text())
        inner = document
        for key in keys[:-1]:
            inner = inner[key]
        inner[keys[-1]] = value
        (tree / path).write_text(json.dumps(document))

    return corrupt


def text(path: str, old: str, new: str) -> Corruption:
    def corrupt(tree: Path) -> None:
        before = (tree / path).read_text()
        assert old in before
        (tree / path).write_text(before.replace(old, new))

    return corrupt


def member(modality: str, change: Callable[[bytes], bytes]) -> Corruption:
    """Change the content of a modality's first member in place, its hash in the index too."""

    def corrupt(tree: Path) -> None:
        table = pq.read_table(tree / MEMBERS)
        index = table["modality"].to_pylist().index(modality)
        row = table.slice(index, 1).to_pylist()[0]
        shard = tree / row["shard"]
        content = bytearray(shard.read_bytes())
        part = slice(row["offset"], row["offset"] + row["size"])
        changed = change(bytes(content[part]))
        assert len(changed) == row["size"]
        content[part] = changed
        shard.write_bytes(content)
        cell(MEMBERS, "sha256", index, hashlib.sha256(changed).hexdigest())(tree)

    return corrupt


def flip(path: str, position: int) -> Corruption:
    def corrupt(tree: Path) -> None:
        content = bytearray((tree / path).read_bytes())
        content[position] ^= 1
        (tree / path).write_bytes(content)

    return corrupt


def write(path: str, content: bytes) -> Corruption:
    def corrupt(tree: Path) -> None:
        (tree / path).write_bytes(content)

    return corrupt


def copy(path: str, to: str) -> Corruption:
    def corrupt(tree: Path) -> None:
        (tree / to).parent.mkdir(exist_ok=True)
        shutil.copy(tree / path, tree / to)

    return corrupt


def remove(path: str) -> Corruption:
    return lambda tree: (tree / path).unlink()


def with_exif(jpeg: bytes) -> bytes:
    """The same length: the JFIF segment's marker becomes an EXIF one."""
    assert jpeg[2:4] == b"\xff\xe0"
    return jpeg[:2] + b"\xff\xe1" + jpeg[4:]


def behind(path: str, content: bytes) -> Corruption:
    """Append to a file."""

    def corrupt(tree: Path) -> None:
        with (tree / path).open("ab") as file:
            file.write(content)

    return corrupt


def hidden_before(path: str) -> Corruption:
    """Another file under the first member's name before it, and an index that passes it by."""

    def corrupt(tree: Path) -> None:
        content = (tree / path).read_bytes()
        (tree / path).write_bytes(content[:512] + b"raw".ljust(-(-_size(content) // 512) * 512) + content)
        table = pq.read_table(tree / MEMBERS)
        shift = (tree / path).stat().st_size - len(content)
        for index, row in enumerate(table.to_pylist()):
            if row["shard"] == path:
                cell(MEMBERS, "offset", index, row["offset"] + shift)(tree)

    return corrupt


def _size(tar: bytes) -> int:
    return int(tar[124:135], 8)


def label(line: bytes) -> Callable[[bytes], bytes]:
    return lambda content: line.ljust(len(content) - 1)[: len(content) - 1] + b"\n"


def first_twice(found: list[Any]) -> list[Any]:
    return [found[0], *found]
