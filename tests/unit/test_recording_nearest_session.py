"""Which session a recording takes, by what the names of files say."""

from pathlib import Path

import pytest

from card.errors import CardError
from card.recording.nearest_session import nearest_session, start_of

SESSIONS = {"2026-04-14-start": 100, "2026-04-14-mid": 200, "2026-04-14-end": 300}


@pytest.mark.parametrize(
    ("start", "part"), [(0, "start"), (149, "start"), (151, "mid"), (249, "mid"), (251, "end"), (999, "end")]
)
def test_the_nearest_session_is_taken(start: int, part: str) -> None:
    assert nearest_session(start, SESSIONS, "drive") == f"2026-04-14-{part}"


def test_of_two_equally_near_ones_it_is_always_the_same() -> None:
    assert nearest_session(150, SESSIONS, "drive") == nearest_session(
        150, dict(reversed(SESSIONS.items())), "drive"
    )


def test_a_day_without_sessions_is_refused() -> None:
    with pytest.raises(CardError, match="drive: no calibration session of that day"):
        nearest_session(0, {}, "drive")


def test_a_recording_starts_with_its_first_file(tmp_path: Path) -> None:
    for sensor, stamps in (("camera_left", (3000, 4000)), ("lidar_rear", (2500, 9000))):
        (tmp_path / sensor).mkdir()
        for stamp in stamps:
            suffix = "jpg" if sensor.startswith("camera") else "laz"
            (tmp_path / sensor / f"{stamp}.{suffix}").touch()
    (tmp_path / "camera_left" / "notes.txt").touch()
    assert start_of(tmp_path) == 2500


def test_a_bag_says_itself_when_it_starts(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  starting_time:\n    nanoseconds_since_epoch: 1776153600000000000\n"
    )
    assert start_of(tmp_path) == 1776153600000000000
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    with pytest.raises(CardError, match="no starting_time of a rosbag2"):
        start_of(tmp_path)


def test_nothing_that_says_when_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"no file says when it starts.*name the session in the sheet"):
        start_of(tmp_path)
