"""What an upload would do: files that are new, changed or deleted, and their bytes."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.packaging.reader.verify import SUMS, read_sums

KEPT = (".gitattributes",)
"""Files that the Hub makes itself."""
DATA = "data/"


@dataclass(frozen=True)
class Remote:
    """A file on the Hub: SHA-256 of a large one, git's hash of a small one."""

    sha256: str | None
    blob: str | None


@dataclass(frozen=True)
class Plan:
    """Bytes by path of what is new and changed, and the paths to delete."""

    repository: str
    new: Mapping[str, int]
    changed: Mapping[str, int]
    deleted: Sequence[str]
    same: int

    @property
    def empty(self) -> bool:
        return not (self.new or self.changed or self.deleted)

    @property
    def bytes(self) -> int:
        return sum(self.new.values()) + sum(self.changed.values())

    def lines(self, limit: int = 20) -> Iterator[str]:
        """The plan as text; long lists are cut after `limit` paths."""
        yield (
            f"{self.repository}: {len(self.new)} new, {len(self.changed)} changed, "
            f"{len(self.deleted)} deleted, {self.same} the same; {self.bytes} bytes to send"
        )
        for word, paths in (("new", self.new), ("changed", self.changed), ("delete", self.deleted)):
            for path in sorted(paths)[:limit]:
                yield f"  {word} {path}"
            if len(paths) > limit:
                yield f"  {word} {len(paths) - limit} more"


def make_plan(tree: Path, repository: str, remote: Mapping[str, Remote]) -> Plan:
    """Plan that turns the files `remote` on the Hub into those of `tree`."""
    files = {path: tree / path for path in sorted([*read_sums(tree), SUMS])}
    sums = read_sums(tree) | {SUMS: hashlib.sha256((tree / SUMS).read_bytes()).hexdigest()}
    new, changed, same = {}, {}, 0
    for path, file in files.items():
        there = remote.get(path)
        if there is None:
            new[path] = file.stat().st_size
        elif _differs(file, sums[path], there):
            changed[path] = file.stat().st_size
        else:
            same += 1
    deleted = sorted(set(remote) - set(files) - set(KEPT))
    return Plan(repository, new, changed, deleted, same)


def batches(plan: Plan, max_files: int, max_bytes: int) -> list[tuple[list[str], list[str]]]:
    """Commits of a plan, as paths to send and to delete each: the shards first, then all else at once.

    So until the last commit the tables of the Hub still tell of the last version.
    """
    sizes = {**plan.new, **plan.changed}
    found: list[tuple[list[str], list[str]]] = []
    paths: list[str] = []
    used = 0
    for path in sorted(path for path in sizes if path.startswith(DATA)):
        if paths and (len(paths) == max_files or used + sizes[path] > max_bytes):
            found.append((paths, []))
            paths, used = [], 0
        paths.append(path)
        used += sizes[path]
    if paths:
        found.append((paths, []))
    rest = sorted(path for path in sizes if not path.startswith(DATA))
    if rest or plan.deleted:
        found.append((rest, list(plan.deleted)))
    return found


def remote_files(api: Any, repository: str, revision: str = "main") -> dict[str, Remote]:
    """Files of a dataset repository on the Hub; none if it does not exist."""
    from huggingface_hub import RepoFile
    from huggingface_hub.errors import RepositoryNotFoundError

    try:
        entries = list(api.list_repo_tree(repository, recursive=True, revision=revision, repo_type="dataset"))
    except RepositoryNotFoundError:
        return {}
    return {
        entry.path: Remote(entry.lfs.sha256 if entry.lfs else None, entry.blob_id)
        for entry in entries
        if isinstance(entry, RepoFile)
    }


def _differs(file: Path, sha256: str, there: Remote) -> bool:
    if there.sha256 is not None:
        return there.sha256 != sha256
    content = file.read_bytes()
    return there.blob != hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()
