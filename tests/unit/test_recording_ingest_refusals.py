"""Everything that can be wrong with a recording, and what ingest says to it."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from recording_samples import (
    FRAMES,
    PERIOD_NS,
    START_NS,
    burst,
    imu_columns,
    ingest_sample,
    jpeg,
    write_recording,
)

from card.artifacts import read_table, write_table
from card.errors import CardError
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.recording.paths import SENSORS, burst_path, image_path, imu_path


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("sound") / "sample")


@pytest.fixture
def root(sound: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(sound, tmp_path / "sample"))


def describe(root: Path, change: Callable[[dict[str, Any]], None]) -> None:
    path = root / "recording.yaml"
    document = yaml.safe_load(path.read_text())
    change(document)
    path.write_text(yaml.safe_dump(document))


def imu(root: Path, change: Callable[[dict[str, Any]], Mapping[str, Any]]) -> None:
    columns = imu_columns(START_NS - 50_000_000, START_NS + (FRAMES + 1) * PERIOD_NS)
    write_table(imu_path(root), change(columns), "imu")


def reversed_imu(root: Path) -> None:
    import pyarrow.parquet as pq

    table = read_table(imu_path(root), "imu")
    pq.write_table(table.take(list(range(table.num_rows))[::-1]), imu_path(root))


def last_burst(root: Path) -> Path:
    return burst_path(root, "lidar_front", START_NS - 30_000_000 + FRAMES * PERIOD_NS)


def moved(path: Path, t_ns: int) -> None:
    """The burst begins at another time."""
    path.unlink()
    one = burst(t_ns)
    write_burst(path.with_name(f"{t_ns}.laz"), one)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


def nan_scale(path: Path) -> None:
    raw = bytearray(path.read_bytes())
    raw[131:139] = np.float64(np.nan).tobytes()
    path.write_bytes(raw)


def empty_burst(path: Path) -> None:
    t_ns = int(path.stem)
    zeros = np.zeros(0, np.uint8)
    write_burst(path, Burst(t_ns, np.zeros((0, 3)), zeros, zeros, np.zeros(0, np.uint32)))


def left(root: Path, index: int) -> Path:
    return image_path(root, "camera_left", START_NS + index * PERIOD_NS)


SPOILED: dict[str, tuple[Callable[[Path], Any], str]] = {
    "recording gone": (shutil.rmtree, r"sample: recording is missing"),
    "description gone": (lambda r: (r / "recording.yaml").unlink(), r"recording.yaml: file is missing"),
    "not YAML": (lambda r: (r / "recording.yaml").write_text("a: [1"), r"recording.yaml: not YAML"),
    "unknown field": (
        lambda r: describe(r, lambda d: d.update(colour="red")),
        r"recording.yaml: document does not fit schema recording .*colour",
    ),
    "clock unknown": (
        lambda r: describe(r, lambda d: d["sensors"]["imu"].update(clock="maybe")),
        r"sensors/imu/clock does not fit schema recording",
    ),
    "still a bag": (
        lambda r: describe(r, lambda d: d.update(bag={"folder": "bag", "topics": {"imu": "/imu"}})),
        r"recording is a bag",
    ),
    "no rear LiDAR": (
        lambda r: shutil.rmtree(r / "lidar_rear"),
        r"modality is missing .found no data of lidar_rear",
    ),
    "no IMU": (lambda r: imu_path(r).unlink(), r"modality is missing .found no data of imu"),
    "not described": (
        lambda r: describe(r, lambda d: d["sensors"].pop("imu")),
        r"modality is not described .wanted sensors: imu",
    ),
    "stray file": (
        lambda r: (r / "lidar_front" / "notes.txt").write_text("x"),
        r"notes.txt: unexpected entry in a sensor folder",
    ),
    "bad name": (
        lambda r: left(r, 1).rename(left(r, 1).with_name("frame1.jpg")),
        r"frame1.jpg: file name is not a time stamp",
    ),
    "LAZ cut off": (lambda r: cut(last_burst(r)), rf"{last_burst(Path()).name}: unreadable LAZ"),
    "NaN points": (
        lambda r: nan_scale(last_burst(r)),
        rf"{last_burst(Path()).name}: points that are not finite",
    ),
    "empty burst": (
        lambda r: empty_burst(last_burst(r)),
        rf"{last_burst(Path()).name}: burst without points",
    ),
    "JPEG cut off": (lambda r: cut(left(r, 3)), rf"{left(Path(), 3).name}: JPEG ends early"),
    "no JPEG": (lambda r: left(r, 3).write_bytes(b"PNG"), rf"{left(Path(), 3).name}: unreadable JPEG"),
    "empty JPEG": (lambda r: left(r, 3).write_bytes(b""), rf"{left(Path(), 3).name}: unreadable JPEG"),
    "image size": (
        lambda r: left(r, 3).write_bytes(jpeg(8, 8)),
        rf"{left(Path(), 3).name}: image size changes .found 8 x 8, wanted 16 x 8",
    ),
    "bursts overlap": (
        lambda r: moved(last_burst(r), int(last_burst(r).stem) - PERIOD_NS // 2),
        r"times of lidar_front go back .found starts 49.950 ms before",
    ),
    "burst gap": (
        lambda r: moved(last_burst(r), int(last_burst(r).stem) + 10 * PERIOD_NS),
        r"times of lidar_front jump .found 1.100 s after \d+, wanted at most 1 s",
    ),
    "burst twice": (
        lambda r: shutil.copy(
            last_burst(r), last_burst(r).with_name(f"{int(last_burst(r).stem) + PERIOD_NS}.laz")
        ),
        r"duplicate burst .found the same as lidar_front/\d+.laz",
    ),
    "image gap": (
        lambda r: image_path(r, "camera_right", START_NS + 30 * PERIOD_NS).write_bytes(jpeg()),
        r"times of camera_right jump",
    ),
    "IMU goes back": (reversed_imu, r"imu.parquet: t_ns does not increase"),
    "IMU gap": (
        lambda r: imu(r, lambda c: {k: np.delete(v, slice(10, 30)) for k, v in c.items()}),
        r"times of imu jump .found 0.210 s",
    ),
    "IMU elsewhere": (
        lambda r: imu(r, lambda c: c | {"t_ns": c["t_ns"] + 3600 * 10**9}),
        r"IMU does not overlap .*wanted an IMU that covers the drive",
    ),
    "IMU empty": (lambda r: imu(r, lambda c: {k: v[:0] for k, v in c.items()}), r"no IMU measurements"),
    "IMU in g": (
        lambda r: imu(r, lambda c: c | {"accel_z": c["accel_z"] / 9.81}),
        r"not in m/s\^2.*found .* 1.00",
    ),
    "IMU in degrees": (
        lambda r: imu(r, lambda c: c | {"gyro_z": c["gyro_z"] + 40.0}),
        r"angular rates are not in rad/s .found up to 40.0",
    ),
    "IMU schema": (
        lambda r: write_table(imu_path(r), {"name": [], "size": [], "sha256": []}, "inventory"),
        r"imu.parquet: wrong columns",
    ),
}


@pytest.mark.parametrize("spoil", SPOILED)
def test_bad_recordings_are_refused_and_nothing_is_written(root: Path, spoil: str) -> None:
    change, message = SPOILED[spoil]
    change(root)
    with pytest.raises(CardError, match=message):
        ingest_sample(root)
    assert not (root.parent / "results").exists()
    assert not (root.parent / "ledger").exists()


def test_a_sensor_that_the_sheet_does_not_name_is_told(root: Path) -> None:
    with pytest.raises(CardError, match=r"has a sensor that the sheet does not name .found lidar_rear"):
        ingest_sample(root, modalities=[name for name in SENSORS if name != "lidar_rear"])
