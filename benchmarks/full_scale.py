"""One simulated drive of real size, opened as the ground truth reads it: what its speed is measured on.

A frame's windows hold 461 bursts with about 14.5 million points, with the rear LiDAR cropped to its half.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from field import field_drive
from field_ground_truth import bursts_of

from card.artifacts import default_settings, read_json, read_table, write_table
from card.artifacts.masks import write_ego_mask
from card.geometry import Trajectory
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.sweeps import Drive
from card.simulation.sessions import delivered_mask

DRIVE, SEED, SECONDS = "it_town_loop", 1, 75.0
SETTINGS = {"rear_crop": "rear_half"}


@dataclass(frozen=True)
class FullScale:
    """The drive with its true poses and calibration, the left camera and the settings."""

    drive: Drive
    camera: LeftCamera
    settings: dict[str, Any]


def open_drive(scratch: Path) -> FullScale:
    """Simulate the drive if it is not there yet; its tables go to `scratch`."""
    source = field_drive(DRIVE, SEED, SECONDS)
    document = read_json(source.calibration, "calibration")
    settings = {**default_settings("ground_truth"), **SETTINGS}
    write_table(scratch / "bursts.parquet", bursts_of(source.recording), "bursts")
    write_ego_mask(scratch / "ego_mask.png", delivered_mask(document))
    poses = Trajectory.from_table(read_table(source.truth / "trajectory.parquet", "trajectory"))
    drive = Drive(source.recording, scratch / "bursts.parquet", document, poses, settings)
    return FullScale(drive, LeftCamera(document, scratch / "ego_mask.png"), settings)
