"""Deterministic uncompressed tars whose members can be read by offset."""

import hashlib
import tarfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from card.errors import CardError

BLOCK = tarfile.BLOCKSIZE
CHUNK = 1 << 20


@dataclass(frozen=True)
class Source:
    """One file to pack: its member name and where its bytes are (a path, or the bytes themselves)."""

    name: str
    content: Path | bytes
    sha256: str | None = None  # what the bytes must hash to, where somebody upstream has stated it


@dataclass(frozen=True)
class Member:
    """One file in a shard; `offset` and `size` in bytes locate its content in the tar."""

    name: str
    shard: str
    offset: int
    size: int
    sha256: str


def write_shards(sources: Iterable[Source], folder: Path, stem: str, max_bytes: int) -> list[Member]:
    """Pack `sources`, sorted by name, into `folder/<stem>-000.tar`, `-001.tar`, ... of at most `max_bytes`.

    Owner, group and time stamps are zero, so equal sources give equal tars. A source that exceeds a
    shard by itself, and one whose bytes differ from its stated hash, is a CardError.
    """
    ordered = sorted(sources, key=lambda source: source.name)
    end = 2 * BLOCK
    members: list[Member] = []
    part, used = -1, max_bytes
    shard: IO[bytes] | None = None
    try:
        for source in ordered:
            size = _size(source)
            needed = BLOCK + _padded(size)
            if needed + end > max_bytes:
                raise CardError(
                    "file larger than a shard",
                    where=source.name,
                    found=f"{size} bytes",
                    wanted=f"at most {max_bytes - BLOCK - end} bytes",
                )
            if used + needed + end > max_bytes:
                if shard is not None:
                    _close(shard)
                part, used = part + 1, 0
                shard = (folder / f"{stem}-{part:03d}.tar").open("wb")
            assert shard is not None
            shard.write(_header(source.name, size))
            sha256 = _copy(source, size, shard)
            members.append(Member(source.name, f"{stem}-{part:03d}.tar", used + BLOCK, size, sha256))
            used += needed
    finally:
        if shard is not None:
            _close(shard)
    return members


def shard_bytes(sizes: Iterable[int]) -> int:
    """Bytes of a shard that holds just files of these sizes."""
    return sum(BLOCK + _padded(size) for size in sizes) + 2 * BLOCK


def _size(source: Source) -> int:
    if isinstance(source.content, bytes):
        return len(source.content)
    try:
        return source.content.stat().st_size
    except FileNotFoundError:
        raise CardError("file is missing", where=source.content, wanted=f"content of {source.name}") from None


def _header(name: str, size: int) -> bytes:
    info = tarfile.TarInfo(name)
    info.size = size
    info.mode = 0o644
    return info.tobuf(tarfile.USTAR_FORMAT, "utf-8", "strict")


def _copy(source: Source, size: int, shard: IO[bytes]) -> str:
    digest = hashlib.sha256()
    if isinstance(source.content, bytes):
        digest.update(source.content)
        shard.write(source.content)
    else:
        copied = 0
        with source.content.open("rb") as file:
            while chunk := file.read(CHUNK):
                digest.update(chunk)
                shard.write(chunk)
                copied += len(chunk)
        if copied != size:
            raise CardError(
                "file changed while it was packed", where=source.content, found=copied, wanted=size
            )
    shard.write(b"\0" * (_padded(size) - size))
    found = digest.hexdigest()
    if source.sha256 is not None and found != source.sha256:
        raise CardError(
            "content differs from what its stage recorded",
            where=source.name,
            found=f"sha256 {found[:12]}",
            wanted=source.sha256[:12],
        )
    return found


def _padded(size: int) -> int:
    return -(-size // BLOCK) * BLOCK


def _close(shard: IO[bytes]) -> None:
    shard.write(b"\0" * (2 * BLOCK))
    shard.close()
