"""The files of each modality of a sequence, named as members of its shards."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.artifacts import read_table
from card.errors import CardError
from card.packaging.shards import Source

CAMERAS = ("camera_left", "camera_right")
LIDARS = ("lidar_front", "lidar_rear")
EXTENSIONS = {
    "camera_left": "jpg",
    "camera_right": "jpg",
    "lidar_front": "laz",
    "lidar_rear": "laz",
    "ground_truth": "npz",
    "labels": "txt",
}
MODALITIES = tuple(EXTENSIONS)

Rows = Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Entry:
    """One member to be: its source and the frame or burst it belongs to."""

    source: Source
    frame: int | None
    burst: int | None


def member_name(sequence: str, number: int, modality: str) -> str:
    """Name of a member; `number` is a burst for the LiDARs and a frame for all others."""
    return f"{sequence}/{number:06d}.{modality}.{EXTENSIONS[modality]}"


def image_entries(
    sequence: str, camera: str, frames: Rows, anonymized: Path, hashes: Mapping[str, str]
) -> list[Entry]:
    """Anonymized images of one camera.

    An image gets in only if `anonymized/images.parquet` lists it, only with the bytes whose hash stands
    there, and only if it was made from the raw image that ingest saw (`hashes`, by relative name); any
    other is a CardError.
    """
    listed = {
        (row["camera"], row["t_ns"]): row
        for row in read_table(anonymized / "images.parquet", "images").to_pylist()
    }
    side = camera.removeprefix("camera_")
    entries = []
    for row in frames:
        if row[f"{side}_file"] is None:
            continue
        t_ns = row["t_ns"] if side == "left" else row["right_t_ns"]
        image = listed.get((camera, t_ns))
        if image is None:
            raise CardError(
                "image was not anonymized",
                where=f"sequence {sequence}, frame {row['frame']}, {camera}",
                found=f"no row for t_ns {t_ns} in {anonymized / 'images.parquet'}",
            )
        raw = recorded_hash(hashes, row[f"{side}_file"])
        if image["source_sha256"] != raw:
            raise CardError(
                "image was anonymized from another raw image",
                where=f"sequence {sequence}, frame {row['frame']}, {camera}",
                found=f"sha256 {image['source_sha256'][:12]}",
                wanted=f"{raw[:12]}; anonymize the sequence again",
            )
        name = member_name(sequence, row["frame"], camera)
        source = Source(name, row["frame"], anonymized / image["file"], image["sha256"])
        entries.append(Entry(source, row["frame"], None))
    return entries


def burst_entries(
    sequence: str, lidar: str, bursts: Rows, folder: Path, hashes: Mapping[str, str]
) -> list[Entry]:
    """Raw bursts of one LiDAR, byte for byte; `hashes` are the recording's, by relative name."""
    entries = []
    for row in bursts:
        if row["lidar"] != lidar:
            continue
        path = folder / Path(row["file"]).name
        sha256 = recorded_hash(hashes, f"{lidar}/{path.name}")
        source = Source(member_name(sequence, row["burst"], lidar), row["burst"], path, sha256)
        entries.append(Entry(source, None, row["burst"]))
    return entries


def recorded_hash(hashes: Mapping[str, str], name: str) -> str:
    """Hash that ingest recorded for a raw file; CardError for a file that it did not see."""
    try:
        return hashes[name]
    except KeyError:
        raise CardError("file is not in the inventory of the recording", where=name) from None


def ground_truth_entries(sequence: str, frames: Rows, folder: Path) -> list[Entry]:
    """Ground truth of the frames that have one, with the hashes its stage recorded."""
    hashes = dict(_inventory(folder))
    return [
        Entry(
            Source(
                member_name(sequence, row["frame"], "ground_truth"), row["frame"], folder / name, hashes[name]
            ),
            row["frame"],
            None,
        )
        for row in frames
        if (name := f"{row['frame']:06d}.npz") in hashes
    ]


def label_entries(sequence: str, states: Rows, labels: Rows, classes: Sequence[str]) -> list[Entry]:
    """YOLO label files: one for each reviewed frame, empty where nothing was found.

    A frame that was not reviewed has no file: its `label_state` says so. `classes` gives the ids.
    """
    lines: dict[int, list[str]] = {}
    for box in labels:
        values = (box[name] for name in ("x_center", "y_center", "width", "height"))
        text = " ".join(repr(float(value)) for value in values)
        lines.setdefault(box["frame"], []).append(f"{classes.index(box['class'])} {text}\n")
    entries = []
    for row in states:
        if row["state"] != "not_reviewed":
            content = "".join(lines.get(row["frame"], ())).encode()
            name = member_name(sequence, row["frame"], "labels")
            source = Source(name, row["frame"], content, hashlib.sha256(content).hexdigest())
            entries.append(Entry(source, row["frame"], None))
    return entries


def _inventory(folder: Path) -> list[tuple[str, str]]:
    table = read_table(folder / "inventory.parquet", "inventory").to_pydict()
    return list(zip(table["name"], table["sha256"], strict=True))
