"""The ingest stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts import inventory as list_files
from card.artifacts import write_report, write_table
from card.errors import CardError
from card.recording.description import read_description
from card.recording.ingest import summary
from card.recording.ingest.bursts import BurstTimes, check_bursts, refuse_copies
from card.recording.ingest.frames import frame_table
from card.recording.ingest.images import check_images
from card.recording.ingest.imu import check_imu
from card.recording.ingest.ledger import number_frames
from card.recording.ingest.modalities import sensor_files
from card.recording.ingest.stamps import largest_gap_ns, share_within
from card.recording.paths import CAMERAS, IMU, LIDARS, description_path, stamp_of


def ingest(
    *,
    recording: Path,
    sequence: Mapping[str, Any],
    ledger: Path,
    frames: Path,
    bursts: Path,
    inventory: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Check the whole recording and write its tables; nothing is written unless all of it is sound.

    recording: folder in the raw layout. sequence: its row of the sheet (`Sequence.as_dict`).
    ledger: the frame numbers given so far, created or added to.
    frames, bursts, inventory, report: artifacts to write, of the schemas of these names.
    settings: as schema ``settings/ingest``. gates: see `write_report`.

    Raises CardError, naming the file, for whatever is missing, unreadable, out of order or at odds.
    """
    description = read_description(recording)
    if "bag" in description:
        raise CardError(
            "recording is a bag", where=description_path(recording), wanted="format rosbag2 in the sheet"
        )
    files = sensor_files(recording, description, sequence)
    stamps: dict[str, npt.NDArray[np.int64]] = {}
    limits: dict[str, int] = {}
    sizes: dict[str, tuple[int, int]] = {}
    for camera in (camera for camera in CAMERAS if camera in files):
        sizes[camera] = check_images(camera, files[camera])
        stamps[camera] = np.array([stamp_of(path) for path in files[camera]], dtype=np.int64)
        limits[camera] = settings["image_gap_ns"]
    sweeps: dict[str, BurstTimes] = {}
    for lidar in (lidar for lidar in LIDARS if lidar in files):
        sweeps[lidar] = check_bursts(lidar, files[lidar], settings["burst_overlap_ns"])
        stamps[lidar] = sweeps[lidar].start_ns
        limits[lidar] = settings["burst_gap_ns"]
    if IMU in files:
        stamps[IMU] = check_imu(files[IMU][0], settings)
        limits[IMU] = settings["imu_gap_ns"]
    gaps = {
        sensor: largest_gap_ns(sensor, t_ns, limits[sensor], recording) for sensor, t_ns in stamps.items()
    }
    coverage = _imu_coverage(recording, stamps, sweeps)
    listing = list_files(recording)
    for lidar in sweeps:
        refuse_copies(lidar, listing)  # type: ignore[arg-type]

    left = stamps.get(CAMERAS[0], np.empty(0, dtype=np.int64))
    numbers = number_frames(ledger, left.tolist())
    table = frame_table(numbers, stamps.get(CAMERAS[1], left[:0]), sweeps, settings)
    write_table(frames, table, "frames")
    write_table(bursts, _burst_table(sweeps, files, recording), "bursts")
    write_table(inventory, listing, "inventory")
    write_report(
        report,
        stage="ingest",
        sequence=sequence["id"],
        settings=settings,
        inputs={"recording": description_path(recording)},
        counts=summary.counts(table, sizes, sweeps, stamps, listing),
        figures=summary.figures(table, gaps, stamps, coverage),
        gates=gates,
        notes=summary.notes(description),
    )


def _imu_coverage(
    recording: Path, stamps: Mapping[str, npt.NDArray[np.int64]], sweeps: Mapping[str, BurstTimes]
) -> dict[str, float]:
    """By sensor the share of its images or bursts whose time the IMU covers; empty without an IMU."""
    if IMU not in stamps:
        return {}
    start_ns, end_ns = int(stamps[IMU][0]), int(stamps[IMU][-1])
    shares = {
        sensor: share_within(t_ns, start_ns, end_ns) for sensor, t_ns in stamps.items() if sensor != IMU
    }
    for sensor, share in shares.items():
        if share == 0.0:
            raise CardError(
                "IMU does not overlap",
                where=recording,
                found=f"IMU {start_ns} to {end_ns}, {sensor} {stamps[sensor][0]} to {stamps[sensor][-1]}",
                wanted="an IMU that covers the drive",
            )
    return shares


def _burst_table(
    sweeps: Mapping[str, BurstTimes], files: Mapping[str, list[Path]], recording: Path
) -> dict[str, Any]:
    parts = [(lidar, sweeps[lidar]) for lidar in LIDARS if lidar in sweeps]
    empty = np.empty(0, dtype=np.int64)
    return {
        "lidar": [lidar for lidar, times in parts for _ in range(len(times))],
        "burst": [number for _, times in parts for number in range(len(times))],
        "t_start_ns": np.concatenate([empty, *(times.start_ns for _, times in parts)]),
        "t_end_ns": np.concatenate([empty, *(times.end_ns for _, times in parts)]),
        "points": np.concatenate([empty, *(times.points for _, times in parts)]),
        "file": [path.relative_to(recording).as_posix() for lidar, _ in parts for path in files[lidar]],
    }
