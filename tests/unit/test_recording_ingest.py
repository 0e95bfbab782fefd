"""Ingest of small recordings: sound ones, and everything that can be wrong with one."""

import json
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
    jpeg,
    sheet_row,
    write_recording,
)

from card.artifacts import default_settings, inventory, read_table, write_table
from card.errors import CardError
from card.recording.burst import Burst
from card.recording.ingest import ingest
from card.recording.ingest.bursts import BurstTimes
from card.recording.ingest.frames import key_bursts, pair_right
from card.recording.ingest.ledger import number_frames
from card.recording.laz import write_burst
from card.recording.paths import SENSORS, burst_path, image_path, imu_path

SETTINGS = default_settings("ingest")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("sound") / "sample")


@pytest.fixture
def root(sound: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(sound, tmp_path / "sample"))


def run(root: Path, sensors: tuple[str, ...] = SENSORS, gates: Any = (), **row: Any) -> Path:
    out = root.parent / "results"
    ingest(
        recording=root,
        sequence=sheet_row(sensors) | row,
        ledger=root.parent / "ledger" / "sample.tsv",
        frames=out / "frames.parquet",
        bursts=out / "bursts.parquet",
        inventory=out / "inventory.parquet",
        report=out / "ingest.report.json",
        settings=SETTINGS,
        gates=gates,
    )
    return out


def frames_of(out: Path) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = read_table(out / "frames.parquet", "frames").to_pydict()
    return columns


def test_the_tables_of_a_sound_recording(root: Path) -> None:
    gates = [{"figure": "imu_coverage", "unit": "1", "better": "higher", "threshold": 1.0}]
    out = run(root, gates=gates)
    frames = frames_of(out)
    assert frames["frame"] == list(range(FRAMES))
    assert frames["t_ns"] == [START_NS + index * PERIOD_NS for index in range(FRAMES)]
    assert frames["left_file"][2] == f"camera_left/{START_NS + 2 * PERIOD_NS}.jpg"
    assert [right - left for right, left in zip(frames["right_t_ns"], frames["t_ns"], strict=True)] == [
        200_000
    ] * FRAMES
    assert all((root / name).is_file() for name in frames["left_file"] + frames["right_file"])
    # Burst k begins 30 ms before frame k and lasts past it.
    assert frames["lidar_front_burst"] == frames["lidar_rear_burst"] == list(range(FRAMES))

    bursts = read_table(out / "bursts.parquet", "bursts").to_pydict()
    assert bursts["lidar"] == ["lidar_front"] * (FRAMES + 1) + ["lidar_rear"] * (FRAMES + 1)
    assert bursts["burst"] == [*range(FRAMES + 1), *range(FRAMES + 1)]
    assert bursts["t_end_ns"][0] - bursts["t_start_ns"][0] == PERIOD_NS - 50_000
    assert set(bursts["points"]) == {200}
    assert all((root / name).is_file() for name in bursts["file"])

    assert read_table(out / "inventory.parquet", "inventory").to_pydict() == inventory(root)
    report = json.loads((out / "ingest.report.json").read_text())
    figures = {figure["name"]: figure["value"] for figure in report["figures"]}
    assert figures["camera_left_rate"] == pytest.approx(10.0)
    assert figures["stereo_offset"] == pytest.approx(0.2)
    assert figures["imu_coverage"] == figures["stereo_paired"] == 1.0
    assert report["gates"][0]["verdict"] == "pass"
    assert report["counts"]["frames"] == FRAMES


def test_the_same_recording_gives_the_same_bytes(root: Path) -> None:
    first = inventory(run(root))
    assert inventory(run(root)) == first


def test_a_lidar_alone_has_no_frames(tmp_path: Path) -> None:
    sensors = ("lidar_front",)
    out = run(write_recording(tmp_path / "sample", sensors), sensors)
    assert frames_of(out)["frame"] == []
    assert read_table(out / "bursts.parquet", "bursts").num_rows == FRAMES + 1


def test_frames_keep_their_numbers(root: Path) -> None:
    run(root)
    ledger = root.parent / "ledger" / "sample.tsv"
    before = ledger.read_text()
    # The third image goes, one comes between the first two, one at the end.
    image_path(root, "camera_left", START_NS + 2 * PERIOD_NS).unlink()
    for t_ns in (START_NS + PERIOD_NS // 2, START_NS + FRAMES * PERIOD_NS):
        image_path(root, "camera_left", t_ns).write_bytes(jpeg())
    frames = frames_of(run(root))
    assert frames["frame"] == [0, 5, 1, 3, 4, 6]
    assert frames["t_ns"] == sorted(frames["t_ns"])
    assert ledger.read_text().startswith(before)
    after = ledger.read_text()
    # It comes back.
    image_path(root, "camera_left", START_NS + 2 * PERIOD_NS).write_bytes(jpeg())
    assert frames_of(run(root))["frame"] == [0, 5, 1, 2, 3, 4, 6]
    assert ledger.read_text() == after


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frame\tt_ns\n0\t5\n2\t6\n", r"ledger of frame numbers was edited.*wanted frame 1"),
        ("frame\tt_ns\n0\t5\n1\t5\n", "has a time twice"),
        ("frame\ttime\n", "wrong columns"),
        ("frame\tt_ns\n0\tx\n", "t_ns does not fit schema frame_ledger"),
    ],
)
def test_an_edited_ledger_is_refused(tmp_path: Path, text: str, message: str) -> None:
    ledger = tmp_path / "ledger.tsv"
    ledger.write_text(text)
    with pytest.raises(CardError, match=message):
        number_frames(ledger, [5, 6])
    assert ledger.read_text() == text


def test_right_images_pair_within_a_millisecond() -> None:
    left = np.array([0, 100, 200, 300]) * 1_000_000
    right = np.array([-900_000, 101_000_000, 201_000_001, 400_000_000])
    assert pair_right(left, right, 1_000_000).tolist() == [0, 1, -1, -1]
    assert pair_right(left, right[:0], 1_000_000).tolist() == [-1] * 4


def test_the_burst_of_a_frame_is_the_first_that_ends_after_it() -> None:
    ends = np.array([100, 200, 300])
    times = BurstTimes(ends - 90, ends, np.ones(3, dtype=np.int64))
    left = np.array([0, 99, 100, 250, 299, 300])
    assert key_bursts(left, times, 60) == [None, 0, None, 2, 2, None]
    assert key_bursts(left, times, 100) == [0, 0, 1, 2, 2, None]
    assert key_bursts(left, None, 100) == [None] * 6


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
    "another id": (
        lambda r: describe(r, lambda d: d.update(id="other")),
        r"id differs from the sheet .found other",
    ),
    "another country": (
        lambda r: describe(r, lambda d: d.update(country="IT")),
        r"country differs from the sheet .found IT, wanted DE",
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
        run(root)
    assert not (root.parent / "results").exists()
    assert not (root.parent / "ledger").exists()


def test_a_sensor_that_the_sheet_does_not_name_is_told(root: Path) -> None:
    with pytest.raises(CardError, match=r"has a sensor that the sheet does not name .found lidar_rear"):
        run(root, modalities=[name for name in SENSORS if name != "lidar_rear"])
