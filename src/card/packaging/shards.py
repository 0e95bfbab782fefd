"""Deterministic uncompressed tars whose members can be read by offset."""

import hashlib
import os
import tarfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from card.errors import CardError

BLOCK = tarfile.BLOCKSIZE
CHUNK = 1 << 20


@dataclass(frozen=True)
class Source:
    """One file to pack: its member name, its frame or burst, and its bytes or the path of them."""

    name: str
    number: int
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


def write_shards(
    sources: Iterable[Source],
    folder: Path,
    stem: str,
    *,
    max_bytes: int,
    numbers: int,
    previous: Path | None = None,
) -> list[Member]:
    """Pack `sources`, sorted by name, into shards `folder/<stem>-<part>.tar`.

    A part holds the sources whose number is in one range of `numbers` numbers; the ranges are halved until
    every part is at most `max_bytes`. So a source that goes or changes touches its own part only. Owner,
    group and time stamps are zero, so equal sources give equal tars.

    previous : folder of an earlier run. A shard there that is the one wanted, byte for byte, is linked.

    A source that exceeds a shard by itself, and one whose bytes differ from its stated hash, is a CardError.
    """
    parts = _parts([(source, _size(source)) for source in sources], max_bytes, numbers)
    members: list[Member] = []
    for part, wanted in sorted(parts.items()):
        name = f"{stem}-{part:03d}.tar"
        old = previous / name if previous is not None else None
        if old is not None and _is_same(old, wanted):
            os.link(old, folder / name)
            hashes = [str(source.sha256) for source, _ in wanted]
        else:
            with (folder / name).open("wb") as shard:
                hashes = [_append(source, size, shard) for source, size in wanted]
                shard.write(b"\0" * (2 * BLOCK))
        offset = 0
        for (source, size), sha256 in zip(wanted, hashes, strict=True):
            members.append(Member(source.name, name, offset + BLOCK, size, sha256))
            offset += BLOCK + _padded(size)
    return members


def shard_bytes(sizes: Iterable[int]) -> int:
    """Bytes of a shard that holds just files of these sizes."""
    return sum(BLOCK + _padded(size) for size in sizes) + 2 * BLOCK


def _parts(
    sized: Sequence[tuple[Source, int]], max_bytes: int, numbers: int
) -> dict[int, list[tuple[Source, int]]]:
    for source, size in sized:
        if shard_bytes([size]) > max_bytes:
            raise CardError(
                "file larger than a shard",
                where=source.name,
                found=f"{size} bytes",
                wanted=f"at most {max_bytes - 3 * BLOCK} bytes",
            )
    ordered = sorted(sized, key=lambda pair: pair[0].name)
    while True:
        parts: dict[int, list[tuple[Source, int]]] = {}
        for source, size in ordered:
            parts.setdefault(source.number // numbers, []).append((source, size))
        if all(shard_bytes(size for _, size in found) <= max_bytes for found in parts.values()):
            return parts
        if numbers == 1:
            raise CardError("files of one number are larger than a shard", where=ordered[0][0].name)
        numbers = -(-numbers // 2)


def _is_same(path: Path, wanted: Sequence[tuple[Source, int]]) -> bool:
    """Whether a shard holds just the wanted members, whose hashes must be stated; reads it through."""
    if not path.is_file() or path.stat().st_size != shard_bytes(size for _, size in wanted):
        return False
    with path.open("rb") as shard:
        for source, size in wanted:
            if source.sha256 is None or shard.read(BLOCK) != _header(source.name, size):
                return False
            digest, left = hashlib.sha256(), size
            while left and (chunk := shard.read(min(CHUNK, left))):
                digest.update(chunk)
                left -= len(chunk)
            if digest.hexdigest() != source.sha256 or any(shard.read(_padded(size) - size)):
                return False
        return not any(shard.read())


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


def _append(source: Source, size: int, shard: IO[bytes]) -> str:
    """Write one member; return the hash of its content."""
    shard.write(_header(source.name, size))
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
