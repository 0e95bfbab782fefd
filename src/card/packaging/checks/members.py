"""The shards hold what the member table says, and each file is what its modality promises."""

import hashlib
import io
import tarfile
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from card.artifacts import progress
from card.packaging.checks.contents import Contents, Row
from card.packaging.checks.jpeg import jpeg_problems
from card.packaging.modalities import member_name
from card.packaging.shards import shard_bytes


def check_members(contents: Contents) -> Iterator[str]:
    """Names, offsets, sizes and hashes of all members, both ways, and the content of each."""
    frames = {(row["sequence"], row["frame"]): row for row in contents.all_frames()}
    by_shard: dict[str, list[Row]] = {}
    for row in contents.members:
        by_shard.setdefault(row["shard"], []).append(row)
        number = row["frame"] if row["burst"] is None else row["burst"]
        if number is None or row["file"] != member_name(row["sequence"], number, row["modality"]):
            yield f"metadata/members.parquet: {row['file']} is misnamed for its frame, burst or modality"
    counts = Counter(row["file"] for row in contents.members)
    for name in sorted(name for name, count in counts.items() if count > 1):
        yield f"metadata/members.parquet: {name} is listed twice"
    for shard, rows in progress(sorted(by_shard.items()), "check shards"):
        path = contents.tree / shard
        if path.is_file():
            yield from _check_shard(path, shard, rows, frames)
        else:
            yield f"{shard}: missing, but the member table refers to it"


def _check_shard(
    path: Path, shard: str, rows: list[Row], frames: dict[tuple[str, int], Row]
) -> Iterator[str]:
    try:
        with tarfile.open(path, "r:") as tar:
            packed = {info.name: (info.offset_data, info.size) for info in tar}
    except (tarfile.TarError, OSError) as error:
        yield f"{shard}: not a readable tar ({error})"
        return
    for name in sorted(set(packed) - {row["file"] for row in rows}):
        yield f"{shard}: {name} is packed but not in the member table"
    # Two members may share a name, and a tar may go on behind its end: neither shows in the names.
    if path.stat().st_size != shard_bytes(row["size"] for row in rows):
        yield f"{shard}: holds bytes that belong to no member of the member table"
    with path.open("rb") as file:
        for row in rows:
            if packed.get(row["file"]) != (row["offset"], row["size"]):
                yield f"{shard}: {row['file']} is not at the offset and size of the member table"
                continue
            file.seek(row["offset"])
            content = file.read(row["size"])
            if hashlib.sha256(content).hexdigest() != row["sha256"]:
                yield f"{shard}: {row['file']} differs from its sha256 in the member table"
                continue
            frame = frames.get((row["sequence"], row["frame"]))
            for problem in _CONTENT[row["modality"]](content, frame or {}):
                yield f"{shard}: {row['file']} {problem}"


def _image(content: bytes, frame: Row) -> Iterator[str]:
    yield from jpeg_problems(content)


def _lidar(content: bytes, frame: Row) -> Iterator[str]:
    if not content.startswith(b"LASF"):
        yield "is not LAZ"


def _ground_truth(content: bytes, frame: Row) -> Iterator[str]:
    import numpy as np

    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            points: Any = archive["points"]
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        yield f"is not an npz with points ({error})"
        return
    if points.dtype != np.float32 or points.ndim != 2 or points.shape[1] != 3:
        yield f"has points {points.dtype} {points.shape}, not float32 (N, 3)"
    elif not np.isfinite(points).all() or (points[:, 2] <= 0).any():
        yield "has points that are not finite or not in front of the camera"
    elif len(points) != frame.get("gt_points"):
        yield f"has {len(points)} points, its frame says {frame.get('gt_points')}"


def _labels(content: bytes, frame: Row) -> Iterator[str]:
    counts = {0: 0, 1: 0}
    for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
        try:
            name, x, y, width, height = (float(cell) for cell in line.split())
        except ValueError:
            yield f"line {number} is not `class x y width height`"
            continue
        if name not in counts:
            yield f"line {number} has an unknown class {name:g}"
        else:
            counts[int(name)] += 1
        inside = x - width / 2 + 1e-6 >= 0 and x + width / 2 <= 1 + 1e-6
        inside = inside and y - height / 2 + 1e-6 >= 0 and y + height / 2 <= 1 + 1e-6
        if not (width > 0 and height > 0 and inside):
            yield f"line {number} has a box outside the image"
    if (counts[0], counts[1]) != (frame.get("boxes_positive"), frame.get("boxes_negative")):
        yield f"has {counts[0]} positive and {counts[1]} negative boxes, its frame says otherwise"
    if frame.get("label_state") != ("boxes" if content else "reviewed_none"):
        yield f"contradicts the label state {frame.get('label_state')}"


_CONTENT = {
    "camera_left": _image,
    "camera_right": _image,
    "lidar_front": _lidar,
    "lidar_rear": _lidar,
    "ground_truth": _ground_truth,
    "labels": _labels,
}
