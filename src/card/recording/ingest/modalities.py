"""Do the sheet, recording.yaml and the files agree?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.errors import CardError
from card.recording.paths import CAMERAS, LIDARS, description_path, imu_path, list_bursts, list_images


def sensor_files(
    recording: Path, description: Mapping[str, Any], sequence: Mapping[str, Any]
) -> dict[str, list[Path]]:
    """The files of each modality of the sheet, in order of time.

    Raises CardError for a modality that has no files or is not described, and for a sensor that the
    recording has and the sheet does not name.
    """
    files: dict[str, list[Path]] = {camera: list_images(recording, camera) for camera in CAMERAS}
    files |= {lidar: list_bursts(recording, lidar) for lidar in LIDARS}
    files["imu"] = [imu_path(recording)] if imu_path(recording).is_file() else []
    named = set(sequence["modalities"])
    for sensor, paths in files.items():
        described = sensor in description["sensors"]
        if sensor in named and not paths:
            raise CardError(
                "modality is missing", where=recording, found=f"no data of {sensor}", wanted="as in the sheet"
            )
        if sensor in named and not described:
            raise CardError(
                "modality is not described", where=description_path(recording), wanted=f"sensors: {sensor}"
            )
        if sensor not in named and (paths or described):
            raise CardError(
                "recording has a sensor that the sheet does not name",
                where=recording,
                found=sensor,
                wanted=f"only {', '.join(sorted(named))}, or another entry in the sheet's modalities",
            )
    return {sensor: paths for sensor, paths in files.items() if paths}
