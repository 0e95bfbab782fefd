"""The sheet and recording.yaml must not contradict each other: the country decides the licence."""

from dataclasses import replace
from pathlib import Path

import pytest

from card.errors import CardError
from card.recording.description import check_identity, write_description
from card.recording.sheet import Sequence

ROW = Sequence(
    id="drive",
    recording="recordings/drive",
    format="native",
    country="DE",
    place="town",
    session="",
    road_type="town",
    light="day",
    role="split",
    off_road=False,
    modalities=("imu",),
    quarantine="",
)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    sensors = {"imu": {"model": "MTi", "clock": "synchronised"}}
    description = {"id": "drive", "rig": "car", "day": "2026-04-14", "place": "town", "country": "DE"}
    write_description(tmp_path, {**description, "sensors": sensors})
    return tmp_path


def test_agreement_passes(recording: Path) -> None:
    check_identity(recording, ROW)


@pytest.mark.parametrize(("field", "value", "found"), [("country", "IT", "DE"), ("id", "other", "drive")])
def test_a_contradiction_is_refused(recording: Path, field: str, value: str, found: str) -> None:
    wanted = rf"recording.yaml: {field} differs from the sheet \(found {found}, wanted {value}\)"
    with pytest.raises(CardError, match=wanted):
        check_identity(recording, replace(ROW, **{field: value}))
