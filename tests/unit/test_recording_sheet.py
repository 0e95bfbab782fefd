"""The sequence sheet."""

from pathlib import Path

import pytest

from card.errors import CardError
from card.recording.paths import SENSORS
from card.recording.sheet import read_sequences

COUNTRIES = {"DE": "CC-BY-4.0", "IT": "CC-BY-NC-4.0"}
CELLS = {
    "id": "town",
    "recording": "recordings/town",
    "format": "native",
    "country": "DE",
    "place": "north",
    "session": "2026-04-14-start",
    "road_type": "town",
    "light": "day",
    "role": "split",
    "off_road": "false",
    "modalities": "all",
    "quarantine": "-",
}
HEADER, GOOD = list(CELLS), list(CELLS.values())


def sheet(tmp_path: Path, *rows: list[str]) -> Path:
    path = tmp_path / "sequences.tsv"
    path.write_text("".join("\t".join(row) + "\n" for row in (HEADER, *rows)))
    return path


def changed(**cells: str) -> list[str]:
    return list((CELLS | cells).values())


def test_rows_are_typed(tmp_path: Path) -> None:
    other = changed(
        id="lab",
        recording="recordings/lab",
        format="rosbag2",
        session="-",
        off_road="true",
        modalities="imu,lidar_front",
        quarantine="faces of children",
    )
    first, second = read_sequences(sheet(tmp_path, GOOD, other), COUNTRIES)
    assert first.modalities == SENSORS
    assert (first.session, first.quarantine, first.off_road) == ("2026-04-14-start", "", False)
    assert second.modalities == ("lidar_front", "imu")
    assert (second.session, second.quarantine, second.off_road) == ("", "faces of children", True)
    assert second.as_dict()["modalities"] == ["lidar_front", "imu"]
    assert list(first.as_dict()) == HEADER


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([GOOD, changed(recording="x")], "duplicate id .found town, wanted each id once"),
        ([GOOD, changed(id="b")], "b: recording used twice .found recordings/town"),
        ([changed(id="Town 1")], r"tsv:2: id does not fit schema sequences .found 'Town 1'"),
        ([changed(country="XX")], "town: country without a licence .found XX, wanted one of DE, IT"),
        ([changed(country="Germany")], "country does not fit schema sequences"),
        ([changed(quarantine="")], "quarantine does not fit schema sequences"),
        ([changed(quarantine=" ")], "quarantine does not fit schema sequences"),
        ([changed(role="train")], "role does not fit schema sequences"),
        ([changed(light="dusk")], "light does not fit schema sequences"),
        ([changed(off_road="no")], "off_road does not fit schema sequences"),
        ([changed(session="yesterday")], "session does not fit schema sequences"),
        ([changed(modalities="lidar_front,radar")], "modalities does not fit schema sequences"),
        ([changed(format="zip")], "format does not fit schema sequences"),
        ([GOOD[:-1]], "tsv:2: wrong number of cells .found 11, wanted 12"),
    ],
)
def test_bad_rows_are_told(tmp_path: Path, rows: list[list[str]], message: str) -> None:
    with pytest.raises(CardError, match=message):
        read_sequences(sheet(tmp_path, *rows), COUNTRIES)


def test_the_sheet_of_the_demo_is_sound() -> None:
    rows = read_sequences(Path(__file__).parents[2] / "config" / "sequences.tsv", COUNTRIES)
    assert {row.id: row.country for row in rows if row.role == "zero_shot"} == {"it_zero_shot": "IT"}
    assert [row.id for row in rows if row.format == "rosbag2"] == ["de_gravel_offroad"]
