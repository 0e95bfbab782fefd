"""What raw data is, as one hash: content counts, times of files do not.

Used while the workflow is parsed, for every recording: nothing beyond the standard library is loaded.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

from card.errors import CardError

# A file changed this short before it was hashed may change again within its time stamp's grain.
_SETTLED_NS = 2_000_000_000


def fingerprint(folder: Path, cache: Path) -> str:
    """SHA-256, hexadecimal, over (name, SHA-256) of all files under `folder`, sorted by name.

    `folder` may be a file; where nothing is there the result is that of an empty folder.
    A file is hashed again only where its size or modification time differ from those in `cache`, a
    JSON file that this function keeps. A damaged cache is as good as none.
    """
    known = _load(cache)
    fresh: dict[str, list[int | str]] = {}
    digest = hashlib.sha256()
    for name, path in _files(folder):
        try:
            stat = path.stat()
        except FileNotFoundError as error:
            raise CardError("link leads nowhere", where=path) from error
        stamp = [stat.st_size, stat.st_mtime_ns]
        entry = known.get(name)
        sha256 = str(entry[2]) if entry and entry[:2] == stamp else _sha256(path)
        fresh[name] = [*stamp, sha256]
        digest.update(f"{name}\0{sha256}\n".encode())
    _save(cache, {name: entry for name, entry in fresh.items() if _is_settled(entry, known.get(name))}, known)
    return digest.hexdigest()


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    if folder.is_file():
        yield folder.name, folder
        return
    found = []
    for root, _, names in os.walk(folder, followlinks=True):
        found += [(Path(root, name).relative_to(folder).as_posix(), Path(root, name)) for name in names]
    yield from sorted(found)


def _is_settled(entry: list[int | str], before: list[int | str] | None) -> bool:
    return entry == before or time.time_ns() - int(entry[1]) > _SETTLED_NS


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _load(cache: Path) -> dict[str, list[int | str]]:
    try:
        entries = json.loads(cache.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(entries, dict):
        return {}
    return {
        name: entry
        for name, entry in entries.items()
        if isinstance(entry, list) and [type(value) for value in entry] == [int, int, str]
    }


def _save(cache: Path, entries: dict[str, list[int | str]], known: dict[str, list[int | str]]) -> None:
    if entries == known and cache.is_file():
        return
    cache.parent.mkdir(parents=True, exist_ok=True)
    # Several jobs parse the workflow at a time: each writes a file of its own and the last one stays.
    partial = cache.with_name(f".{cache.name}.{os.getpid()}")
    partial.write_text(json.dumps(entries, indent=0, sort_keys=True), encoding="utf-8")
    os.replace(partial, cache)
