"""What the ingest report says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts import Figure
from card.recording.ingest.bursts import BurstTimes
from card.recording.paths import CAMERAS, LIDARS


def counts(
    table: Mapping[str, list[Any]],
    sizes: Mapping[str, tuple[int, int]],
    sweeps: Mapping[str, BurstTimes],
    stamps: Mapping[str, npt.NDArray[np.int64]],
    listing: Mapping[str, Sequence[Any]],
) -> dict[str, int]:
    """Counts by name: frames, files, bytes, image sizes, data of each sensor, frames that lack something."""
    found = {"frames": len(table["frame"]), "files": len(listing["name"]), "bytes": sum(listing["size"])}
    for camera, (width, height) in sizes.items():
        found |= {f"{camera}_width_px": width, f"{camera}_height_px": height}
    found |= {f"{sensor}_stamps": len(t_ns) for sensor, t_ns in stamps.items()}
    found |= {f"{lidar}_points": int(times.points.sum()) for lidar, times in sweeps.items()}
    for name in ("right_file", *(f"{lidar}_burst" for lidar in LIDARS)):
        found[f"frames_without_{name}"] = sum(value is None for value in table[name])
    return found


def figures(
    table: Mapping[str, list[Any]],
    gaps: Mapping[str, int],
    stamps: Mapping[str, npt.NDArray[np.int64]],
    coverage: Mapping[str, float],
) -> list[Figure]:
    """Gaps, rates, how well images pair and what the IMU covers: see each one's description."""
    found = [Figure(f"{sensor}_gap", gap / 1e9, "s", "largest step of time") for sensor, gap in gaps.items()]
    for sensor, t_ns in stamps.items():
        rate = (len(t_ns) - 1) / (t_ns[-1] - t_ns[0]) * 1e9 if len(t_ns) > 1 else None
        found.append(Figure(f"{sensor}_rate", rate, "Hz", "mean rate"))
    offsets = [
        abs(right - left)
        for right, left in zip(table["right_t_ns"], table["t_ns"], strict=True)
        if right is not None
    ]
    if CAMERAS[1] in stamps:
        found.append(
            Figure(
                "stereo_offset",
                max(offsets) / 1e6 if offsets else None,
                "ms",
                "largest time between the images of a pair",
            )
        )
        found.append(
            Figure(
                "stereo_paired",
                len(offsets) / max(len(table["frame"]), 1),
                "1",
                "share of frames with a pair",
            )
        )
    if coverage:
        found.append(
            Figure(
                "imu_coverage",
                min(coverage.values()),
                "1",
                "least share of a sensor's data that the IMU covers",
            )
        )
    return found


def notes(description: Mapping[str, Any]) -> list[str]:
    """What a user of the recording should know about its sensors."""
    remarks = []
    for name, sensor in sorted(description["sensors"].items()):
        if sensor["clock"] == "free_running":
            remarks.append(f"{name} is free-running: its times were put on the host's clock")
        if sensor.get("deskewed"):
            remarks.append(f"{name} was delivered deskewed")
    return remarks
