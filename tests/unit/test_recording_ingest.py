"""Ingest of small recordings that are sound: tables, numbers of frames, pairs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_samples import (
    FRAMES,
    PERIOD_NS,
    START_NS,
    ingest_sample,
    jpeg,
    write_recording,
)

from card.artifacts import inventory, read_table
from card.errors import CardError
from card.recording.ingest.bursts import BurstTimes
from card.recording.ingest.frames import key_bursts, pair_right
from card.recording.ingest.ledger import number_frames
from card.recording.paths import image_path


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "sample")


def frames_of(out: Path) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = read_table(out / "frames.parquet", "frames").to_pydict()
    return columns


def test_the_tables_of_a_sound_recording(root: Path) -> None:
    gates = [{"figure": "imu_coverage", "unit": "1", "better": "higher", "threshold": 1.0}]
    out = ingest_sample(root, gates=gates)
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
    first = inventory(ingest_sample(root))
    assert inventory(ingest_sample(root)) == first


def test_a_lidar_alone_has_no_frames(tmp_path: Path) -> None:
    sensors = ("lidar_front",)
    out = ingest_sample(write_recording(tmp_path / "sample", sensors), sensors)
    assert frames_of(out)["frame"] == []
    assert read_table(out / "bursts.parquet", "bursts").num_rows == FRAMES + 1


def test_frames_keep_their_numbers(root: Path) -> None:
    ingest_sample(root)
    ledger = root.parent / "ledger" / "sample.tsv"
    before = ledger.read_text()
    # The third image goes, one comes between the first two, one at the end.
    image_path(root, "camera_left", START_NS + 2 * PERIOD_NS).unlink()
    for t_ns in (START_NS + PERIOD_NS // 2, START_NS + FRAMES * PERIOD_NS):
        image_path(root, "camera_left", t_ns).write_bytes(jpeg())
    frames = frames_of(ingest_sample(root))
    assert frames["frame"] == [0, 5, 1, 3, 4, 6]
    assert frames["t_ns"] == sorted(frames["t_ns"])
    assert ledger.read_text().startswith(before)
    after = ledger.read_text()
    # It comes back.
    image_path(root, "camera_left", START_NS + 2 * PERIOD_NS).write_bytes(jpeg())
    assert frames_of(ingest_sample(root))["frame"] == [0, 5, 1, 2, 3, 4, 6]
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
