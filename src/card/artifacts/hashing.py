"""Content hashes of files and folders."""

import hashlib
from pathlib import Path


def sha256_file(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def inventory(folder: Path) -> dict[str, list[str] | list[int]]:
    """Columns of schema ``inventory`` for all files under a folder, sorted by their relative name."""
    files = sorted(
        (path.relative_to(folder).as_posix(), path) for path in folder.rglob("*") if path.is_file()
    )
    return {
        "name": [name for name, _ in files],
        "size": [path.stat().st_size for _, path in files],
        "sha256": [sha256_file(path) for _, path in files],
    }
