"""Stage `package`: one sequence as shards, tables and sidecars, without its split."""

import math
import shutil
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from card.artifacts import (
    Figure,
    atomic_folder,
    inventory,
    load_schema,
    progress,
    read_json,
    read_table,
    sha256_file,
    write_json,
    write_report,
    write_table,
)
from card.errors import CardError
from card.packaging.entries import gather_entries
from card.packaging.frame_rows import frame_columns
from card.packaging.modalities import Entry, recorded_hash
from card.packaging.quality import gather_quality
from card.packaging.redactions import redactions_of_kept
from card.packaging.sequence_row import sequence_document
from card.packaging.shards import write_shards
from card.packaging.takedowns import Takedown, gone, tombstones

Settings = Mapping[str, Any]


def pack_sequence(
    *,
    sequence: Mapping[str, Any],
    spdx: str,
    frames: Path,
    bursts: Path,
    recording_inventory: Path,
    reports: Mapping[str, Path],
    out: Path,
    report: Path,
    settings: Settings,
    gates: Sequence[Mapping[str, Any]],
    lidar_front: Path | None = None,
    lidar_rear: Path | None = None,
    imu: Path | None = None,
    calibration: Path | None = None,
    poses: Path | None = None,
    wheel_excitation: Path | None = None,
    road_planes: Path | None = None,
    ground_truth: Path | None = None,
    anonymized: Path | None = None,
    labels: Path | None = None,
    label_states: Path | None = None,
    regions: Path | None = None,
    takedowns: Sequence[Takedown] = (),
) -> None:
    """Pack one sequence into the folder `out`; what it lacks (None) is left out.

    Raw images are not among the inputs, and no split is: a package stays as it is when splits change. Shards
    of an earlier package in `out` that stay the same are not written again.

    Parameters
    ----------
    sequence : row of the sequence sheet.
    spdx : licence of every file of this sequence.
    recording_inventory : names and hashes of the raw recording.
    lidar_front, lidar_rear : folders of raw bursts; ground_truth, anonymized : folders of their stages.
    reports : stage -> report of every stage this package stands on.
    takedowns : entries of `read_takedowns` for this sequence; regions : folder of images filled for them.

    CardError for an image that was not anonymized or from another raw image, a region that was not filled,
    a takedown of frames that are not there, images without a privacy report, content that differs from the
    hash its stage recorded, a failed gate (see `quality`), and artifacts that break their schema.
    """
    if anonymized and "privacy" not in reports:
        raise CardError("images without a report of the privacy stage", where=f"sequence {sequence['id']}")
    quality = gather_quality(sequence["id"], reports)
    all_frames = read_table(frames, "frames").to_pylist()
    states = read_table(label_states, "label_states").to_pylist() if label_states else []
    boxes = read_table(labels, "labels").to_pylist() if labels else []
    raw = read_table(recording_inventory, "inventory").to_pydict()
    hashes = dict(zip(raw["name"], raw["sha256"], strict=True))

    if imu and sha256_file(imu) != recorded_hash(hashes, "imu.parquet"):
        raise CardError("content differs from what ingest recorded", where=imu)

    burst_rows = read_table(bursts, "bursts").to_pylist()
    entries = gather_entries(
        sequence["id"],
        frames=all_frames,
        bursts=burst_rows,
        hashes=hashes,
        lidars={"lidar_front": lidar_front, "lidar_rear": lidar_rear},
        ground_truth=ground_truth,
        anonymized=anonymized,
        regions=regions,
        states=states if label_states else None,
        boxes=boxes,
        classes=settings["classes"],
        takedowns=takedowns,
    )
    taken = gone(takedowns, all_frames)["camera_left"]
    frame_rows = [row for row in all_frames if row["frame"] not in taken]

    sidecars = {
        "calibration.json": (calibration, "calibration"),
        "poses.json": (poses, "poses"),
        "wheel_excitation.json": (wheel_excitation, "wheel_excitation"),
        "road_planes.parquet": (road_planes, "road_planes"),
        "imu.parquet": (imu, "imu"),
    }
    files = {
        "frames": frames,
        "bursts": bursts,
        "recording": recording_inventory,
        "labels": labels,
        "label_states": label_states,
        "ground_truth": ground_truth / "inventory.parquet" if ground_truth else None,
        "anonymized": anonymized / "inventory.parquet" if anonymized else None,
        "regions": regions / "inventory.parquet" if regions else None,
        **{Path(name).stem: path for name, (path, _) in sidecars.items()},
    }
    sources = {name: path for name, path in files.items() if path is not None}

    with atomic_folder(out) as folder:
        members = _write_members(folder, sequence["id"], spdx, entries, settings, previous=out / "data")
        stones = tombstones(takedowns, all_frames)
        names = load_schema("package_retractions")["columns"]
        write_table(
            folder / "retractions.parquet",
            {name: [row[name] for row in stones] for name in names},
            "package_retractions",
        )
        coverage = (
            read_table(ground_truth / "coverage.parquet", "coverage").to_pylist() if ground_truth else []
        )
        columns = frame_columns(sequence, spdx, frame_rows, entries, states, boxes, coverage)
        write_table(folder / "frames.parquet", columns, "package_frames")
        (folder / "sidecars").mkdir()
        for name, (path, schema) in sidecars.items():
            if path is not None:
                (read_json if path.suffix == ".json" else read_table)(path, schema)
                shutil.copyfile(path, folder / "sidecars" / name)
        if anonymized:
            redactions = redactions_of_kept(anonymized / "redactions.parquet", taken)
            write_table(folder / "sidecars" / "redactions.parquet", redactions, "redactions")
        write_json(folder / "sidecars" / "quality.json", quality, "quality")
        provenance = {
            "schema": "provenance",
            "sequence": sequence["id"],
            "country": sequence["country"],
            "spdx": spdx,
            "sources": {name: sha256_file(path) for name, path in sorted(sources.items())},
        }
        write_json(folder / "sidecars" / "provenance.json", provenance, "provenance")
        distance_m = _distance(poses) if poses else None
        document = sequence_document(sequence, spdx, columns, members, burst_rows, distance_m)
        write_json(folder / "sequence.json", document, "release_sequence")
        write_table(folder / "inventory.parquet", inventory(folder), "inventory")

    write_report(
        report,
        stage="packaging",
        sequence=sequence["id"],
        settings=settings,
        inputs=sources,
        counts={f"{modality}_files": len(found) for modality, found in entries.items()}
        | {"frames": len(frame_rows), "files": len(members["file"]), "bytes": sum(members["size"])},
        figures=[
            Figure(
                "unreviewed_frames",
                len(frame_rows) - len(entries.get("labels", ())),
                "frames",
                "Frames whose labels nobody has reviewed",
            )
        ],
        gates=gates,
    )


def _write_members(
    folder: Path,
    sequence: str,
    spdx: str,
    entries: Mapping[str, Sequence[Entry]],
    settings: Settings,
    previous: Path,
) -> dict[str, list[Any]]:
    """Write the shards and `members.parquet`; shard paths are those of the release tree."""
    (folder / "data").mkdir()
    names = ("file", "sequence", "modality", "frame", "burst", "shard", "offset", "size", "sha256", "spdx")
    columns: dict[str, list[Any]] = {name: [] for name in names}
    for modality, found in progress(sorted(entries.items()), f"pack {sequence}"):
        by_name = {entry.source.name: entry for entry in found}
        members = write_shards(
            (entry.source for entry in found),
            folder / "data",
            modality,
            max_bytes=settings["shard_max_bytes"],
            numbers=settings["shard_frames"],
            previous=previous,
        )
        for member in members:
            entry = by_name[member.name]
            row = (
                member.name,
                sequence,
                modality,
                entry.frame,
                entry.burst,
                f"data/{sequence}/{member.shard}",
                member.offset,
                member.size,
                member.sha256,
                spdx,
            )
            for name, value in zip(names, row, strict=True):
                columns[name].append(value)
    write_table(folder / "members.parquet", columns, "release_members")
    return columns


def _distance(poses: Path) -> float:
    """Length of the track through all poses, m."""
    rows = sorted(read_json(poses, "poses")["poses"], key=lambda row: row["t_ns"])
    track = [row["translation_m"] for row in rows]
    return sum(math.dist(before, after) for before, after in pairwise(track))
