"""The annotation stage on a small drive."""

import json
from pathlib import Path

import pytest

from card.annotations.import_labels import import_labels
from card.artifacts import default_settings, read_table, write_report, write_table
from card.errors import CardError

TIMES = [1_000, 2_000, 3_000, 4_000]
GOOD = "0 0.5 0.5 0.2 0.1\n"


@pytest.fixture
def drive(tmp_path) -> Path:
    """Four frames, numbered 10 to 13, of 100 x 80 px; nobody has labelled them. No image is there."""
    recording = tmp_path / "town"
    (recording / "annotations" / "labels").mkdir(parents=True)
    (recording / "annotations" / "classes.txt").write_text("positive\nnegative\n")
    size = {"camera_left_width_px": 100, "camera_left_height_px": 80}
    write_report(tmp_path / "ingest.report.json", stage="ingest", settings={}, inputs={}, counts=size)
    none = [None] * len(TIMES)
    columns = {
        "frame": [10, 11, 12, 13],
        "t_ns": TIMES,
        "left_file": [f"camera_left/{t_ns}.jpg" for t_ns in TIMES],
        **dict.fromkeys(("right_file", "right_t_ns", "lidar_front_burst", "lidar_rear_burst"), none),
    }
    write_table(tmp_path / "frames.parquet", columns, "frames")
    return recording


def run(
    recording: Path, off_road: bool = False, **settings: object
) -> tuple[list[dict], dict[int, str], dict]:
    out = recording.parent / "results" / "town"
    import_labels(
        annotations=recording / "annotations",
        frames=recording.parent / "frames.parquet",
        ingest_report=recording.parent / "ingest.report.json",
        off_road=off_road,
        labels=out / "labels.parquet",
        label_states=out / "label_states.parquet",
        issues=out / "annotation_issues.parquet",
        report=out / "annotations.report.json",
        settings=default_settings("annotations") | settings,
        gates=[{"figure": "reviewed_pct", "unit": "%", "better": "higher", "threshold": 50.0}],
    )
    states = read_table(out / "label_states.parquet", "label_states").to_pylist()
    return (
        read_table(out / "labels.parquet", "labels").to_pylist(),
        {row["frame"]: row["state"] for row in states},
        json.loads((out / "annotations.report.json").read_text()),
    )


def issues_of(recording: Path) -> list[tuple[str, int, str, str]]:
    path = recording.parent / "results" / "town" / "annotation_issues.parquet"
    rows = read_table(path, "annotation_issues").to_pylist()
    return [(row["file"], row["line"], row["code"], row["severity"]) for row in rows]


def write(recording: Path, name: str, content: str) -> None:
    (recording / "annotations" / name).write_text(content)


def test_three_states_and_boxes_by_frame(drive):
    write(drive, "labels/4000.txt", "1 0.25 0.5 0.1 0.2\n0 0.75 0.5 0.1 0.2\n")
    write(drive, "labels/2000.txt", "")
    boxes, states, report = run(drive)
    assert states == {10: "not_reviewed", 11: "reviewed_none", 12: "not_reviewed", 13: "boxes"}
    assert [(b["frame"], b["class"], b["x_center"]) for b in boxes] == [
        (13, "negative", 0.25),
        (13, "positive", 0.75),
    ]
    assert report["counts"] == {
        "frames": 4,
        "frames_not_reviewed": 2,
        "frames_reviewed_none": 1,
        "frames_boxes": 1,
        "boxes_positive": 1,
        "boxes_negative": 1,
        "repairs": 0,
        "warnings": 0,
        "off_road": 0,
    }
    assert report["gates"][0]["verdict"] == "pass"
    statistics = {figure["name"]: figure["value"] for figure in report["figures"]}
    assert statistics["boxes_per_frame"] == 2
    assert (statistics["box_width_px"], statistics["box_height_px"]) == (
        pytest.approx(10),
        pytest.approx(16),
    )


def test_nobody_labelled_yet(drive):
    (drive / "annotations" / "labels").rmdir()
    boxes, states, report = run(drive)
    assert boxes == []
    assert set(states.values()) == {"not_reviewed"}
    assert report["figures"][0]["value"] == 0
    assert report["gates"][0]["verdict"] == "fail"


def test_repairs_and_warnings_are_listed(drive):
    write(drive, "labels/1000.txt", GOOD + GOOD.replace("\n", " \r\n"))
    boxes, _, report = run(drive)
    assert len(boxes) == 2
    assert issues_of(drive) == [
        ("labels/1000.txt", 2, "crlf", "repair"),
        ("labels/1000.txt", 2, "near_duplicate", "warn"),
        ("labels/1000.txt", 2, "stray_blanks", "repair"),
    ]
    assert (report["counts"]["repairs"], report["counts"]["warnings"]) == (2, 1)


def test_class_ids_follow_the_pinned_map(drive):
    write(drive, "classes.txt", "negative\r\npositive\r\n")
    write(drive, "labels/1000.txt", GOOD)
    boxes, _, _ = run(drive, classes=["negative", "positive"])
    assert boxes[0]["class"] == "negative"
    assert issues_of(drive) == [("classes.txt", 1, "crlf", "repair")]


@pytest.mark.parametrize(
    ("name", "content", "where", "code"),
    [
        ("labels/5000.txt", GOOD, "labels/5000.txt:0", "orphan_label"),
        ("labels/1000.xml", "<annotation/>", "labels/1000.xml:0", "foreign_file"),
        ("labels/1000.TXT", GOOD, "labels/1000.TXT:0", "foreign_file"),
        ("labels/1000.txt", GOOD + "0 0.5 0.5 0.2 nan\n", "labels/1000.txt:2", "not_finite"),
        ("classes.txt", "negative\npositive\n", "classes.txt:1", "class_map"),
        ("classes.txt", "positive\n", "classes.txt:2", "class_map"),
        ("classes.txt", "positive\nnegative\ndog\n", "classes.txt:3", "class_map"),
        ("labels/classes.txt", "positive\nhole\n", "labels/classes.txt:2", "class_map"),
    ],
)
def test_errors_name_file_and_line_and_leave_no_labels(drive, name, content, where, code):
    write(drive, "labels/4000.txt", GOOD)
    write(drive, name, content)
    with pytest.raises(CardError, match=f"/{where}: {code}: "):
        run(drive)
    file, line = where.split(":")
    assert issues_of(drive) == [(file, int(line), code, "error")]
    assert not (drive.parent / "results" / "town" / "labels.parquet").exists()


def test_missing_class_map_is_an_error(drive):
    write(drive, "labels/1000.txt", GOOD)
    (drive / "annotations" / "classes.txt").unlink()
    with pytest.raises(CardError, match="class_map: file is missing, wanted positive, negative"):
        run(drive)


def test_all_errors_are_counted_and_logged(drive, caplog):
    write(drive, "labels/1000.txt", "0 0.5 0.5 0.2 0\n3 0.5 0.5 0.2 0.1\n")
    write(drive, "labels/9000.txt", GOOD)
    with pytest.raises(CardError, match=r"1000.txt:1: no_extent: .*; 2 more errors in the log"):
        run(drive)
    assert len(issues_of(drive)) == 3
    assert "9000.txt:0: orphan_label" in caplog.text


def test_size_that_ingest_did_not_state_is_an_error(drive):
    write_report(drive.parent / "ingest.report.json", stage="ingest", settings={}, inputs={}, counts={})
    with pytest.raises(CardError, match=r"ingest.report.json: size of the left image is not stated"):
        run(drive)


def test_off_road_flag_is_kept(drive):
    _, _, report = run(drive, off_road=True)
    assert report["counts"]["off_road"] == 1
    assert any(note.startswith("off-road") for note in report["notes"])


def test_other_formats_give_the_same_table_and_name_theirs(drive):
    write(drive, "labels/1000.txt", GOOD)
    expected, _, report = run(drive)
    assert report["notes"] == ["labels in format yolo"]
    (drive / "annotations" / "labels" / "1000.txt").unlink()
    size = "<size><width>100</width><height>80</height></size>"
    edges = "<xmin>40</xmin><ymin>36</ymin><xmax>60</xmax><ymax>44</ymax>"
    thing = f"<object><name>positive</name><bndbox>{edges}</bndbox></object>"
    write(drive, "1000.xml", f"<annotation><filename>1000.jpg</filename>{size}{thing}</annotation>")
    boxes, _, report = run(drive)
    assert report["notes"] == ["labels in format voc"]
    assert boxes[0] == pytest.approx(expected[0])


def test_format_of_the_setting_wins(drive):
    write(drive, "labels/1000.txt", GOOD)
    write(drive, "notes.json", "{}")
    with pytest.raises(CardError, match=r"mixed_formats: found coco in notes.json, yolo in labels"):
        run(drive)
    boxes, _, _ = run(drive, format="yolo")
    assert len(boxes) == 1
