"""What was taken out of the dataset, and the tombstones that a release keeps of it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import read_yaml
from card.errors import CardError
from card.packaging.modalities import CAMERAS, LIDARS, Rows

PER_FRAME = (*CAMERAS, "ground_truth", "labels")
"""What goes with a frame; LiDAR goes only where a takedown names it."""

Takedown = Mapping[str, Any]


def read_takedowns(path: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Entries of `config/takedowns.yaml` with `frames` as [first, last], null for a whole sequence.

    `sequences` are the ids of the sheet. CardError for an unknown one, a range that ends before it starts,
    and an image region without a frame.
    """
    entries = []
    for number, entry in enumerate(read_yaml(path, "takedowns")["takedowns"]):
        where = f"{path}, takedowns/{number}"
        frames = entry.get("frames")
        frames = [frames, frames] if isinstance(frames, int) else frames
        if entry["sequence"] not in sequences:
            raise CardError("takedown of an unknown sequence", where=where, found=entry["sequence"])
        if frames and frames[1] < frames[0]:
            raise CardError("range ends before it starts", where=where, found=frames)
        region = entry.get("region")
        if region and not frames:
            raise CardError("region without a frame", where=where, wanted="frames")
        if region and (region["x_max"] <= region["x_min"] or region["y_max"] <= region["y_min"]):
            raise CardError("region is empty", where=where, found=region)
        entries.append(
            {
                "sequence": entry["sequence"],
                "frames": frames,
                "lidar": sorted(entry.get("lidar", [])),
                "region": region,
                "reason": entry["reason"],
                "date": entry["date"],
            }
        )
    return entries


def whole_sequences(takedowns: Sequence[Takedown]) -> set[str]:
    """Sequences that were taken down whole."""
    return {entry["sequence"] for entry in takedowns if entry["frames"] is None}


def frames_of(entry: Takedown, frames: Rows) -> list[Mapping[str, Any]]:
    """Rows of the frames that an entry names; CardError where the sequence has none of these numbers."""
    first, last = entry["frames"]
    found = [row for row in frames if first <= row["frame"] <= last]
    if not found:
        raise CardError(
            "takedown of frames that the sequence does not have",
            where=f"takedowns of {entry['sequence']}",
            found=f"{first}..{last}",
        )
    return found


def gone(takedowns: Sequence[Takedown], frames: Rows) -> dict[str, set[int]]:
    """Numbers that must not be packed, by modality: frames, and bursts of a LiDAR."""
    found: dict[str, set[int]] = {modality: set() for modality in (*PER_FRAME, *LIDARS)}
    for entry in takedowns:
        if entry["region"]:
            continue
        for row in frames_of(entry, frames):
            for modality in PER_FRAME:
                found[modality].add(row["frame"])
            for lidar in entry["lidar"]:
                if row[f"{lidar}_burst"] is not None:
                    found[lidar].add(row[f"{lidar}_burst"])
    return found


def tombstones(takedowns: Sequence[Takedown], frames: Rows) -> list[dict[str, Any]]:
    """Rows of `package_retractions` of one sequence, sorted: what went, and why, but not who asked."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}

    def add(entry: Takedown, modality: str, number: int, region: bool) -> None:
        frame, burst = (None, number) if modality in LIDARS else (number, None)
        row = {
            "sequence": entry["sequence"], "modality": modality, "frame": frame, "burst": burst,
            "region": region, "reason": entry["reason"], "date": entry["date"],
        }  # fmt: skip
        key = (modality, number)
        # The earliest statement stands; a whole file outdoes a part of it.
        if key not in rows or (rows[key]["region"], rows[key]["date"]) > (region, entry["date"]):
            rows[key] = row

    for entry in takedowns:
        for row in frames_of(entry, frames):
            if entry["region"]:
                add(entry, entry["region"]["camera"], row["frame"], True)
                continue
            for modality in PER_FRAME:
                add(entry, modality, row["frame"], False)
            for lidar in entry["lidar"]:
                if row[f"{lidar}_burst"] is not None:
                    add(entry, lidar, row[f"{lidar}_burst"], False)
    return [row for _, row in sorted(rows.items())]


def whole_tombstones(takedowns: Sequence[Takedown]) -> list[dict[str, Any]]:
    """Rows of `package_retractions` of sequences that went whole."""
    rows: dict[str, dict[str, Any]] = {}
    for entry in sorted(takedowns, key=lambda entry: (entry["sequence"], entry["date"])):
        if entry["frames"] is None:
            row = {name: entry[name] for name in ("sequence", "reason", "date")}
            rows.setdefault(
                entry["sequence"], row | {"modality": None, "frame": None, "burst": None, "region": False}
            )
    return list(rows.values())
