"""Where things are in a recording folder.

<recording>/recording.yaml
<recording>/camera_left|camera_right/<t_ns>.jpg
<recording>/lidar_front|lidar_rear/<t_ns>.laz     t_ns is the start of the burst
<recording>/imu.parquet
"""

from __future__ import annotations

from pathlib import Path

from card.errors import CardError

CAMERAS = ("camera_left", "camera_right")
LIDARS = ("lidar_front", "lidar_rear")
IMU = "imu"
#: Every modality a recording can have, in the order used in tables and reports.
SENSORS = (*CAMERAS, *LIDARS, IMU)

IMAGE_SUFFIX = ".jpg"
BURST_SUFFIX = ".laz"


def description_path(root: Path) -> Path:
    """The recording.yaml of a recording folder."""
    return root / "recording.yaml"


def imu_path(root: Path) -> Path:
    """The IMU table of a recording folder."""
    return root / "imu.parquet"


def image_path(root: Path, camera: str, t_ns: int) -> Path:
    """The image a camera took at `t_ns` (nanoseconds, mid-exposure)."""
    return root / camera / f"{t_ns}{IMAGE_SUFFIX}"


def burst_path(root: Path, lidar: str, t_ns: int) -> Path:
    """The burst a LiDAR started at `t_ns` (nanoseconds)."""
    return root / lidar / f"{t_ns}{BURST_SUFFIX}"


def list_images(root: Path, camera: str) -> list[Path]:
    """The images of one camera in order of time; none if the folder is absent.

    Raises CardError for a file whose name is not a time stamp.
    """
    return _in_order_of_time(root / camera, IMAGE_SUFFIX)


def list_bursts(root: Path, lidar: str) -> list[Path]:
    """The bursts of one LiDAR in order of time; none if the folder is absent.

    Raises CardError for a file whose name is not a time stamp.
    """
    return _in_order_of_time(root / lidar, BURST_SUFFIX)


def stamp_of(path: Path) -> int:
    """Nanoseconds from a file named <t_ns>.<suffix>; CardError otherwise."""
    # isdecimal alone lets other scripts' digits through, int() would take "1_0" and " 1".
    if not (path.stem.isascii() and path.stem.isdecimal()) or str(int(path.stem)) != path.stem:
        raise CardError(
            "file name is not a time stamp",
            where=path,
            found=path.name,
            wanted=f"<t_ns>{path.suffix}, decimal nanoseconds without leading zeros",
        )
    return int(path.stem)


def _in_order_of_time(folder: Path, suffix: str) -> list[Path]:
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if not path.name.startswith(".")]
    for path in found:
        if path.suffix != suffix or not path.is_file():
            raise CardError(
                "unexpected entry in a sensor folder", where=path, wanted=f"files <t_ns>{suffix} only"
            )
    return sorted(found, key=stamp_of)
