"""All files of a sequence that a release may hold, less what was taken down."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from card.artifacts import read_table
from card.errors import CardError
from card.packaging.modalities import (
    CAMERAS,
    Entry,
    Rows,
    burst_entries,
    ground_truth_entries,
    image_entries,
    label_entries,
)
from card.packaging.takedowns import Takedown, frames_of, gone


def gather_entries(
    sequence: str,
    *,
    frames: Rows,
    bursts: Rows,
    hashes: Mapping[str, str],
    lidars: Mapping[str, Path | None],
    ground_truth: Path | None,
    anonymized: Path | None,
    regions: Path | None,
    states: Rows | None,
    boxes: Rows,
    classes: Sequence[str],
    takedowns: Sequence[Takedown],
) -> dict[str, list[Entry]]:
    """Members to be by modality; arguments as of `pack_sequence`, `frames` and `states` with all frames.

    CardError for an image that was not anonymized or whose region was not filled.
    """
    found: dict[str, list[Entry]] = {}
    if anonymized:
        for camera in CAMERAS:
            images = image_entries(sequence, camera, frames, anonymized, hashes)
            found[camera] = _with_regions(sequence, camera, images, frames, regions, takedowns)
    for lidar, folder in lidars.items():
        if folder:
            found[lidar] = burst_entries(sequence, lidar, bursts, folder, hashes)
    if ground_truth:
        found["ground_truth"] = ground_truth_entries(sequence, frames, ground_truth)
    if states is not None:
        found["labels"] = label_entries(sequence, states, boxes, classes)
    taken = gone(takedowns, frames)
    return {
        modality: [entry for entry in entries if entry.source.number not in taken[modality]]
        for modality, entries in found.items()
    }


def _with_regions(
    sequence: str,
    camera: str,
    images: Sequence[Entry],
    frames: Rows,
    regions: Path | None,
    takedowns: Sequence[Takedown],
) -> list[Entry]:
    """The images of one camera, those with a region taken down from the folder where it was filled."""
    wanted = {
        row["frame"]
        for entry in takedowns
        if entry["region"] and entry["region"]["camera"] == camera
        for row in frames_of(entry, frames)
    }
    if not wanted:
        return list(images)
    table = read_table(regions / "images.parquet", "images").to_pylist() if regions else []
    filled = {row["t_ns"]: row for row in table if row["camera"] == camera}
    times = {row["frame"]: row["t_ns" if camera == "camera_left" else "right_t_ns"] for row in frames}
    entries = []
    for entry in images:
        if entry.frame in wanted:
            image = filled.get(times[entry.frame])
            if regions is None or image is None or image["source_sha256"] != entry.source.sha256:
                raise CardError(
                    "region that was taken down is not filled",
                    where=f"sequence {sequence}, frame {entry.frame}, {camera}",
                    wanted="a row of the filled images made from the anonymized one",
                )
            source = replace(entry.source, content=regions / image["file"], sha256=image["sha256"])
            entry = replace(entry, source=source)
        entries.append(entry)
    return entries
