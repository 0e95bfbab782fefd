"""What both stages read of a recording: sweeps and IMU, by its calibration."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table
from card.estimation.imu import Imu, read_imu
from card.estimation.scans import Limits, Scans
from card.recording.description import read_description
from card.recording.paths import imu_path


def open_scans(recording: Path, bursts: Path, calibration: Path, settings: Mapping[str, Any]) -> Scans:
    """The sweeps of a recording that the settings choose."""
    low, high = settings["azimuth_deg"]
    return Scans(
        recording,
        read_table(bursts, "bursts"),
        read_json(calibration, "calibration"),
        read_description(recording)["sensors"],
        settings["lidars"],
        Limits(settings["min_range_m"], settings["max_range_m"], (low, high)),
    )


def open_imu(
    recording: Path, calibration: Path, start_ns: int | None = None, end_ns: int | None = None
) -> Imu:
    """The corrected samples of a recording's IMU, all or those within a span of time.

    Raises
    ------
    CardError
        If there is none.
    """
    corrections = read_json(calibration, "calibration").get("imu_corrections")
    return read_imu(read_table(imu_path(recording), "imu"), corrections, start_ns, end_ns)
