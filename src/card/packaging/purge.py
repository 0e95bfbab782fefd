"""Remove from a copy of an older version what was retracted since."""

import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import (
    atomic_file,
    load_schema,
    read_json,
    read_table,
    sha256_file,
    write_json,
    write_table,
)
from card.packaging.files_table import file_columns
from card.packaging.reader import SPLITS, Release
from card.packaging.reader.verify import SUMS, read_sums
from card.packaging.redactions import redactions_of_kept
from card.packaging.shards import Source, write_shards

MEMBERS = "metadata/members.parquet"
Rows = list[dict[str, Any]]


def purge(copy: Path, release: Release) -> list[str]:
    """Delete from `copy` what `release`, the current version, lists as retracted; the names of what went.

    `copy` is a tree, or a folder of extracted files. Of a tree the shards that held something are written
    again without it, and tables and checksums are made to fit; its pages stay. An image of which a region was
    filled goes unless it is the filled one.
    """
    retractions = release.retractions()
    if not (copy / MEMBERS).is_file():
        return _purge_files(copy, release, retractions)
    members = read_table(copy / MEMBERS, "release_members").to_pylist()
    whole = {row["sequence"] for row in retractions if row["modality"] is None}
    bad = {
        row["file"]
        for row in members
        if row["sequence"] in whole or _is_bad(row, row["sha256"], release, retractions)
    }
    if bad:
        _rewrite_tree(copy, members, bad, whole, release)
    return sorted(bad)


def _is_bad(row: Mapping[str, Any], sha256: str, release: Release, retractions: Rows) -> bool:
    key = ("sequence", "modality", "frame", "burst")
    stones = [stone for stone in retractions if all(stone[name] == row[name] for name in key)]
    if not stones:
        return False
    if not all(stone["region"] for stone in stones):
        return True
    number = row["frame"] if row["burst"] is None else row["burst"]
    return sha256 != release.sha256(row["sequence"], number, row["modality"])


def _purge_files(copy: Path, release: Release, retractions: Rows) -> list[str]:
    gone = []
    for path in sorted(path for path in copy.rglob("*") if path.is_file()):
        number, _, rest = path.name.partition(".")
        modality = rest.partition(".")[0]
        if not number.isdigit():
            continue
        frame, burst = (None, int(number)) if modality.startswith("lidar_") else (int(number), None)
        row = {"sequence": path.parent.name, "modality": modality, "frame": frame, "burst": burst}
        whole = any(
            stone["sequence"] == path.parent.name and stone["modality"] is None for stone in retractions
        )
        if whole or _is_bad(row, sha256_file(path), release, retractions):
            path.unlink()
            gone.append(path.relative_to(copy).as_posix())
    return gone


def _rewrite_tree(copy: Path, members: Rows, bad: set[str], whole: set[str], release: Release) -> None:
    kept: Rows = []
    by_shard: dict[str, Rows] = {}
    for row in members:
        by_shard.setdefault(row["shard"], []).append(row)
    for shard, rows in by_shard.items():
        left = [row for row in rows if row["file"] not in bad]
        kept += _rewrite_shard(copy / shard, left) if len(left) < len(rows) else rows
    for sequence in whole:
        for folder in ("data", "sequences"):
            shutil.rmtree(copy / folder / sequence, ignore_errors=True)
    packed = {
        (row["modality"], row["sequence"], row["frame"] if row["burst"] is None else row["burst"])
        for row in kept
    }
    stones = release.retractions()
    gone = {(s["sequence"], s["frame"]) for s in stones if s["modality"] == "camera_left" and not s["region"]}

    def stays(row: Mapping[str, Any]) -> bool:
        return row["sequence"] not in whole and (row["sequence"], row["frame"]) not in gone

    frames: Rows = []
    for split in SPLITS:
        path = copy / f"metadata/frames-{split}.parquet"
        rows = [row for row in read_table(path, "release_frames").to_pylist() if stays(row)]
        for row in rows:
            for modality in ("camera_left", "camera_right"):
                row[f"has_{modality}"] = (modality, row["sequence"], row["frame"]) in packed
            for lidar in ("lidar_front", "lidar_rear"):
                row[f"has_{lidar}"] = (lidar, row["sequence"], row[f"{lidar}_burst"]) in packed
        _write(path, rows, "release_frames")
        frames += rows
    for path in sorted(copy.glob("sequences/*/redactions.parquet")):
        taken = {frame for sequence, frame in gone if sequence == path.parent.name}
        write_table(path, redactions_of_kept(path, taken), "redactions")
    pictured = {(row["sequence"], row["frame"]) for row in frames if row["has_camera_left"]}
    mini = read_table(copy / "mini/mini.parquet", "release_mini").to_pylist()
    edited = {(s["sequence"], s["frame"]) for s in stones if s["modality"] == "camera_left" and s["region"]}
    _write(
        copy / "mini/mini.parquet",
        [row for row in mini if (key := (row["sequence"], row["frame"])) in pictured and key not in edited],
        "release_mini",
    )
    _write(copy / MEMBERS, kept, "release_members")
    _write(copy / "metadata/retractions.parquet", stones, "retractions")
    sequences = _sequences(copy, frames, kept, whole)
    about = read_json(copy / "release.json", "release")
    counts = Counter(row["split"] for row in frames)
    about |= {
        "sequences": [row["sequence"] for row in sequences],
        "frames": {split: counts[split] for split in SPLITS},
        "files": len(kept),
        "bytes": sum(row["size"] for row in kept),
    }
    write_json(copy / "release.json", about, "release")
    paths = [path.relative_to(copy).as_posix() for path in copy.rglob("*") if path.is_file()]
    columns = file_columns(paths, about["sequences"], about["spdx"])
    write_table(copy / "metadata/files.parquet", columns, "release_files")
    _write_sums(copy)


def _rewrite_shard(path: Path, rows: Rows) -> Rows:
    """Write a shard again with just these members; their rows with the new offsets."""
    content = path.read_bytes() if rows else b""
    path.unlink()
    if not rows:
        return []
    sources = [
        Source(row["file"], 0, content[row["offset"] : row["offset"] + row["size"]], row["sha256"])
        for row in rows
    ]
    stem, _, part = path.stem.rpartition("-")
    members = {
        member.name: member
        for member in write_shards(sources, path.parent, f".{stem}", max_bytes=len(content) + 1024, numbers=1)
    }
    (path.parent / f".{stem}-000.tar").rename(path.parent / f"{stem}-{part}.tar")
    return [row | {"offset": members[row["file"]].offset} for row in rows]


def _sequences(copy: Path, frames: Rows, members: Rows, whole: set[str]) -> Rows:
    path = copy / "metadata/sequences.parquet"
    rows = [row for row in read_table(path, "release_sequences").to_pylist() if row["sequence"] not in whole]
    for row in rows:
        own = [frame for frame in frames if frame["sequence"] == row["sequence"]]
        files = [member for member in members if member["sequence"] == row["sequence"]]
        found = {member["modality"] for member in files}
        row |= {
            "frames": len(own),
            "reviewed_frames": sum(frame["label_state"] != "not_reviewed" for frame in own),
            "boxes_positive": sum(frame["boxes_positive"] for frame in own),
            "boxes_negative": sum(frame["boxes_negative"] for frame in own),
            "files": len(files),
            "bytes": sum(member["size"] for member in files),
            "modalities": ",".join(name for name in row["modalities"].split(",") if name in found),
        }
    _write(path, rows, "release_sequences")
    return rows


def _write_sums(copy: Path) -> None:
    sums = {path: sha256_file(copy / path) for path in read_sums(copy) if (copy / path).is_file()}
    document = read_json(copy / "croissant.json", "croissant")
    document["distribution"] = [
        file | ({"sha256": sums[file["@id"]]} if file["@id"] in sums else {})
        for file in document["distribution"]
        if file["@id"] in sums or "sha256" not in file
    ]
    write_json(copy / "croissant.json", document, "croissant")
    sums["croissant.json"] = sha256_file(copy / "croissant.json")
    with atomic_file(copy / SUMS) as partial:
        partial.write_text(
            "".join(f"{sha}  {path}\n" for path, sha in sorted(sums.items())), encoding="utf-8"
        )


def _write(path: Path, rows: Sequence[Mapping[str, Any]], schema: str) -> None:
    write_table(path, {name: [row[name] for row in rows] for name in load_schema(schema)["columns"]}, schema)
