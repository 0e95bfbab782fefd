"""What changed between two releases, and the version that calls for (https://semver.org)."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table
from card.errors import CardError
from card.packaging.reader import SPLITS
from card.packaging.reader.verify import read_sums

RECORDED = ("release.json", "SHA256SUMS", "metadata/members.parquet", "metadata/retractions.parquet",
            *(f"metadata/frames-{split}.parquet" for split in SPLITS))  # fmt: skip
"""Files of a tree that are enough to compare it with another."""
BUMPS = ("none", "patch", "minor", "major")
DATA = ("sequences/", "data/")
LATER = ("changes.json", "croissant.json")
"""Written after the comparison."""


@dataclass(frozen=True)
class Records:
    """What a tree, or the record of one that was sent, says it holds."""

    about: Mapping[str, Any]
    files: Mapping[str, str]
    members: Mapping[str, str]
    frames: Mapping[tuple[str, int], Mapping[str, Any]]
    retractions: list[dict[str, Any]]


def read_records(folder: Path) -> Records:
    """Records of a release tree, or of a folder with just the files `RECORDED`."""
    members = read_table(folder / "metadata/members.parquet", "release_members").to_pydict()
    rows = [
        row
        for split in SPLITS
        for row in read_table(folder / f"metadata/frames-{split}.parquet", "release_frames").to_pylist()
    ]
    return Records(
        about=read_json(folder / "release.json", "release"),
        files=read_sums(folder),
        members=dict(zip(members["file"], members["sha256"], strict=True)),
        frames={(row["sequence"], row["frame"]): row for row in rows},
        retractions=read_table(folder / "metadata/retractions.parquet", "retractions").to_pylist(),
    )


def changes(old: Records | None, new: Records) -> dict[str, Any]:
    """Document `changes` from `old`, None for the first release, to `new`.

    A record removed or edited calls for a major version, one added for a minor, other files for a patch.
    Records are the files in the shards, the sidecars of sequences and the rows of frames; a frame that gets
    its first split counts as added.
    """
    before = old or Records({"version": None, "sequences": []}, {}, {}, {}, [])
    rows = {name: _rows(records.frames) for name, records in (("old", before), ("new", new))}
    moved = [
        {"sequence": key[0], "frame": key[1], "from": rows["old"][key][0], "to": rows["new"][key][0]}
        for key in sorted(rows["old"].keys() & rows["new"].keys())
        if rows["old"][key][0] not in (rows["new"][key][0], "unassigned")
    ]
    files = {
        name: {path: sha for path, sha in records.files.items() if path.startswith("sequences/")}
        for name, records in (("old", before), ("new", new))
    }
    contents = (
        {key: row[1] for key, row in rows["old"].items()},
        {key: row[1] for key, row in rows["new"].items()},
    )
    first = sum(
        rows["old"][key][0] == "unassigned" != rows["new"][key][0]
        for key in contents[0].keys() & contents[1].keys()
    )
    pages = {
        name: {
            path: sha
            for path, sha in records.files.items()
            if not path.startswith(DATA) and path not in LATER
        }
        for name, records in (("old", before), ("new", new))
    }
    document = {
        "schema": "changes",
        "repository": new.about["repository"],
        "from": before.about["version"],
        "to": new.about["version"],
        "sequences": {
            "added": sorted(set(new.about["sequences"]) - set(before.about["sequences"])),
            "removed": sorted(set(before.about["sequences"]) - set(new.about["sequences"])),
        },
        "files": _difference(before.members, new.members),
        "sidecars": _difference(files["old"], files["new"]),
        "frames": _difference(
            *({f"{s}/{n:06d}": row for (s, n), row in found.items()} for found in contents)
        ),
        "assigned_frames": first,
        "moved_frames": moved,
        "other_files_changed": pages["old"] != pages["new"],
    }
    return document | {"bump": bump(document)}


def bump(document: Mapping[str, Any]) -> str:
    """Least part of the version that has to rise."""
    kinds = [document[name] for name in ("files", "sidecars", "frames")]
    if any(kind["removed"] or kind["edited"] for kind in kinds) or document["moved_frames"]:
        return "major"
    if any(kind["added"] for kind in kinds) or document["assigned_frames"]:
        return "minor"
    return "patch" if document["other_files_changed"] else "none"


def check_version(document: Mapping[str, Any]) -> None:
    """CardError where a frame moved to another split, or the version rose by too little."""
    if document["moved_frames"]:
        moved = document["moved_frames"][0]
        raise CardError(
            "a released frame moved to another split",
            where=f"{document['repository']}, {moved['sequence']} frame {moved['frame']}",
            found=moved["to"],
            wanted=moved["from"],
        )
    if document["from"] is None:
        return
    wanted = next_version(document["from"], document["bump"])
    if _numbers(document["to"]) < _numbers(wanted):
        raise CardError(
            f"the changes call for a {document['bump']} version",
            where=f"{document['repository']}, packaging.release.version",
            found=document["to"],
            wanted=f"at least {wanted}",
        )


def next_version(version: str, part: str) -> str:
    """The version after `version` with this part raised."""
    major, minor, patch = _numbers(version)
    if part == "major":
        return f"{major + 1}.0.0"
    if part == "minor":
        return f"{major}.{minor + 1}.0"
    return f"{major}.{minor}.{patch + 1}" if part == "patch" else version


def latest_records(folder: Path, repository: str, version: str) -> list[Path]:
    """Records under `folder` of the newest release before `version`, then of `version` itself, if there."""
    found = [path.parent for path in (folder / repository).glob("*/release.json")]
    before = [path for path in found if _numbers(path.name) < _numbers(version)]
    return sorted(before, key=lambda path: _numbers(path.name))[-1:] + [
        path for path in found if path.name == version
    ]


def _numbers(version: str) -> tuple[int, int, int]:
    try:
        major, minor, patch = (int(part) for part in version.split("."))
    except ValueError:
        raise CardError("not a semantic version", found=version, wanted="<major>.<minor>.<patch>") from None
    return major, minor, patch


def _rows(frames: Mapping[tuple[str, int], Mapping[str, Any]]) -> dict[tuple[str, int], tuple[str, str]]:
    """Split of each frame, and everything else in its row."""
    apart = ("split", "group", "stratum", "sampled")
    return {
        key: (row["split"], repr({name: value for name, value in row.items() if name not in apart}))
        for key, row in frames.items()
    }


def _difference(old: Mapping[str, str], new: Mapping[str, str]) -> dict[str, Any]:
    """Names that went or changed, and how many came."""
    return {
        "removed": sorted(old.keys() - new.keys()),
        "edited": sorted(name for name in old.keys() & new.keys() if old[name] != new[name]),
        "added": len(new.keys() - old.keys()),
    }
