"""Splits of one sequence, and rows for new ones."""

import json
from pathlib import Path
from typing import Any

import pytest

from card.artifacts import default_settings, load_schema, read_table, write_table
from card.cli import main
from card.errors import CardError
from card.splits import assign, extend_ledger
from card.splits.ledger import COLUMNS, Row
from card.splits.strata import sequence_topography, topography

SETTINGS = default_settings("splits")


def sheet_row(name: str = "a", role: str = "split", off_road: bool = False) -> dict[str, Any]:
    return {
        "id": name,
        "place": "town",
        "role": role,
        "off_road": off_road,
        "modalities": ["camera_left"],
        "quarantine": "",
    }


def write_inputs(folder: Path, count: int = 9) -> dict[str, Path]:
    folder.mkdir(parents=True, exist_ok=True)
    numbers = list(range(count))
    frames = {
        "frame": numbers,
        "t_ns": [100 * n for n in numbers],
        "left_file": [f"camera_left/{100 * n}.jpg" for n in numbers],
        **dict.fromkeys(
            ("right_file", "right_t_ns", "lidar_front_burst", "lidar_rear_burst"), [None] * count
        ),
    }
    states = ["not_reviewed" if n == 0 else "boxes" if n in (3, 6) else "reviewed_none" for n in numbers]
    boxes = {"frame": [3, 6, 6], "class": ["positive", "positive", "negative"]}
    boxes |= dict.fromkeys(("x_center", "y_center", "width", "height"), [0.5] * 3)
    write_table(folder / "frames.parquet", frames, "frames")
    write_table(folder / "labels.parquet", boxes, "labels")
    write_table(folder / "label_states.parquet", {"frame": numbers, "state": states}, "label_states")
    return {name: folder / f"{name}.parquet" for name in ("frames", "labels", "label_states")}


def ledger_row(first: int, last: str, split: str, sequence: str = "a") -> dict[str, str]:
    return dict(zip(COLUMNS, (sequence, str(first), last, split, "none/town", "g"), strict=True))


def run(
    tmp_path: Path, rows: list[dict[str, str]], sequence: dict[str, Any] | None = None, **settings: Any
) -> Any:
    assign(
        sequence=sequence or sheet_row(),
        **write_inputs(tmp_path),
        rows=rows,
        splits=tmp_path / "splits.parquet",
        report=tmp_path / "splits.report.json",
        settings=SETTINGS | settings,
        gates=[],
    )
    return read_table(tmp_path / "splits.parquet", "splits").to_pydict()


def test_every_third_frame_takes_the_split_of_its_row(tmp_path: Path) -> None:
    table = run(tmp_path, [ledger_row(0, "4", "train"), ledger_row(5, "-", "test")])
    sampled = [split for frame, split in enumerate(table["split"]) if frame in (0, 3, 6)]
    assert sampled == ["train", "train", "test"]
    assert table["split"].count("unassigned") == 6
    assert table["sampled"] == [frame % 3 == 0 for frame in range(9)]
    assert set(table["group"]) == {"g"}


def test_offset_and_step_move_the_sample(tmp_path: Path) -> None:
    table = run(tmp_path, [ledger_row(0, "-", "train")], frame_step=4, frame_offset=1)
    assert [frame for frame, split in enumerate(table["split"]) if split == "train"] == [1, 5]


def test_frames_without_a_row_are_unassigned_and_reported(tmp_path: Path) -> None:
    table = run(tmp_path, [ledger_row(3, "5", "validation")])
    assert [table["split"][frame] for frame in (0, 3, 6)] == ["unassigned", "validation", "unassigned"]
    assert table["group"][0] is None
    report = json.loads((tmp_path / "splits.report.json").read_text())
    assert report["figures"][0]["value"] == 6
    assert report["notes"] == []  # a gap between two blocks
    run(tmp_path, [])
    report = json.loads((tmp_path / "splits.report.json").read_text())
    assert "assign_splits" in report["notes"][0]


@pytest.mark.parametrize("rows", [[], [ledger_row(0, "-", "zero_shot")]])
def test_a_zero_shot_sequence_is_kept_whole(tmp_path: Path, rows: list[dict[str, str]]) -> None:
    table = run(tmp_path, rows, sheet_row(role="zero_shot"))
    assert set(table["split"]) == {"zero_shot"}
    assert all(table["sampled"])


@pytest.mark.parametrize(("role", "split"), [("split", "zero_shot"), ("zero_shot", "test")])
def test_ledger_and_role_must_agree(tmp_path: Path, role: str, split: str) -> None:
    with pytest.raises(CardError, match=r"sequence a: the ledger and the sheet disagree.*found role"):
        run(tmp_path, [ledger_row(0, "-", split)], sheet_row(role=role))


def test_a_row_of_another_sequence_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CardError, match="another sequence"):
        run(tmp_path, [ledger_row(0, "-", "train", sequence="b")])


def test_strata_come_from_the_labels_of_each_frame(tmp_path: Path) -> None:
    table = run(tmp_path, [ledger_row(0, "-", "train")])
    found = [table["stratum"][frame] for frame in (0, 1, 3, 6)]
    assert found == ["unknown/town", "none/town", "positive/town", "negative/town"]


def test_off_road_holds_for_a_whole_sequence(tmp_path: Path) -> None:
    assert topography(["positive"], "boxes", off_road=True) == "off_road"
    table = run(tmp_path, [], sheet_row(off_road=True))
    assert set(table["stratum"]) == {"off_road/town"}


def test_topography_of_a_sequence_is_its_rarest() -> None:
    assert sequence_topography(["none", "positive", "unknown"]) == "positive"
    assert sequence_topography(["none", "unknown"]) == "none"
    assert sequence_topography([]) == "unknown"


def extend(tmp_path: Path, sheet: list[dict[str, Any]], ledger: Path) -> list[Row]:
    anchors = tmp_path / "anchors.tsv"
    anchors.write_text("\t".join(load_schema("anchors")["properties"]) + "\n")
    return extend_ledger(
        sequences=sheet, results=tmp_path / "results", ledger=ledger, anchors=anchors, settings=SETTINGS
    )


def test_extending_appends_new_sequences_only(tmp_path: Path) -> None:
    ledger = tmp_path / "splits.tsv"
    old = "\t".join(COLUMNS) + "\na\t0\t-\ttest\tnone/town\ta\n"
    ledger.write_text(old)
    for name in ("a", "b", "z"):
        write_inputs(tmp_path / "results" / name)
    sheet = [
        sheet_row("a"),
        sheet_row("b"),
        sheet_row("z", role="zero_shot"),
        sheet_row("q") | {"quarantine": "bad"},
    ]
    rows = extend(tmp_path, sheet, ledger)
    assert [(row.sequence, row.split, row.stratum) for row in rows] == [
        ("b", "train", "negative/town"),
        ("z", "zero_shot", "negative/town"),
    ]
    assert ledger.read_text().startswith(old)
    after = ledger.read_bytes()
    assert extend(tmp_path, sheet, ledger) == []
    assert ledger.read_bytes() == after


def test_a_sequence_without_results_cannot_be_assigned(tmp_path: Path) -> None:
    ledger = tmp_path / "splits.tsv"
    ledger.write_text("\t".join(COLUMNS) + "\n")
    with pytest.raises(CardError, match=r"sequence a: the sequence is not processed yet"):
        extend(tmp_path, [sheet_row()], ledger)


def test_the_command_line_extends_the_ledger_of_the_config(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    licenses = Path(__file__).resolve().parents[2] / "config" / "licenses.yaml"
    cells = "de_new\trecordings/de_new\tnative\tDE\ttown\t-\ttown\tday\tsplit\tfalse\tall\t-"
    header = "\t".join(load_schema("sequences")["properties"])
    (tmp_path / "sheet.tsv").write_text(f"{header}\n{cells}\n")
    (tmp_path / "splits.tsv").write_text("\t".join(COLUMNS) + "\n")
    (tmp_path / "config.yaml").write_text(
        f"sheet: sheet.tsv\nlicenses: {licenses}\nsplits_ledger: splits.tsv\n"
        "splits: {train_share: 0, test_share: 1}\n"
    )
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "anchors.tsv").write_text("\t".join(load_schema("anchors")["properties"]) + "\n")
    write_inputs(tmp_path / "results" / "de_new")
    monkeypatch.chdir(tmp_path)
    assert main(["splits", "extend", "--config", "config.yaml"]) == 0
    assert "1 rows appended to splits.tsv" in capsys.readouterr().out
    row = (tmp_path / "splits.tsv").read_text().splitlines()[-1]
    assert row == "de_new\t0\t-\ttest\tnegative/town\tde_new"
