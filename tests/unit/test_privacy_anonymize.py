"""The stage on a small drive whose images hold a real face."""

import hashlib
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from card.artifacts import default_settings, read_table, write_table
from card.errors import CardError
from card.privacy.anonymize import anonymize
from card.privacy.redaction import FILL
from card.privacy.search import search

GATE = {"figure": "recall_face_pct", "unit": "%", "better": "higher", "threshold": 99.0}
PLATE_GATE = GATE | {"figure": "recall_plate_pct"}


@pytest.fixture
def drive(tmp_path) -> Path:
    """Three frames of 160 x 150 px, the last without a right image; the face is some 60 px high."""
    recording = tmp_path / "recordings" / "town"
    face = cv2.resize(data.astronaut()[0:256, 90:346, ::-1], (160, 150), interpolation=cv2.INTER_AREA)
    columns = {name: [] for name in ("frame", "t_ns", "left_file", "right_file", "right_t_ns")}
    for frame in range(3):
        row = {"frame": frame, "t_ns": 10**9 + frame * 10**8, "right_t_ns": None, "right_file": None}
        for camera, shift in (("left", 0), ("right", 11)):
            if frame == 2 and camera == "right":
                continue
            t_ns = row["t_ns"] + shift
            path = recording / f"camera_{camera}" / f"{t_ns}.jpg"
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.roll(face, 3 * frame - shift, axis=1))
            row[f"{camera}_file"] = f"camera_{camera}/{t_ns}.jpg"
            if camera == "right":
                row["right_t_ns"] = t_ns
        for name in columns:
            columns[name].append(row[name])
    none = [None] * 3
    write_table(
        tmp_path / "frames.parquet",
        columns | {"lidar_front_burst": none, "lidar_rear_burst": none},
        "frames",
    )
    return recording


def run(recording: Path, results: str = "town", threads: int = 1, gates=(), **settings: object) -> Path:
    root = recording.parents[1]
    out = root / "results" / results / "anonymized"
    chosen = default_settings("privacy") | settings
    search_images(recording, out.parent, threads, chosen)
    anonymize(
        recording=recording,
        frames=root / "frames.parquet",
        detections=out.parent / "privacy_search",
        sight={},
        labelled=recording / "privacy_labels.csv",
        reviews=recording / "privacy_review.csv",
        out=out,
        report=out.parent / "privacy.report.json",
        settings=chosen,
        gates=gates,
        threads=threads,
    )
    return out


def search_images(recording: Path, results: Path, threads: int, settings: dict) -> None:
    search(
        recording=recording,
        frames=recording.parents[1] / "frames.parquet",
        out=results / "privacy_search",
        report=results / "privacy_search.report.json",
        settings=settings,
        threads=threads,
    )


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


def report_of(out: Path) -> dict:
    return json.loads((out.parent / "privacy.report.json").read_text())


def label(recording: Path, *rows: str) -> None:
    text = "camera,t_ns,kind,x_min,y_min,x_max,y_max\n" + "".join(f"{row}\n" for row in rows)
    (recording / "privacy_labels.csv").write_text(text)


def test_every_image_gets_one_output_and_one_row(drive):
    out = run(drive)
    images = read_table(out / "images.parquet", "images").to_pylist()
    names = [row["file"] for row in images]
    assert names == [f"camera_left/{10**9 + k * 10**8}.jpg" for k in range(3)] + [
        f"camera_right/{10**9 + k * 10**8 + 11}.jpg" for k in range(2)
    ]
    assert {name for name in bytes_of(out) if name.endswith(".jpg")} == set(names)
    for row in images:
        assert row["sha256"] == hashlib.sha256((out / row["file"]).read_bytes()).hexdigest()
        assert row["source_sha256"] == hashlib.sha256((drive / row["file"]).read_bytes()).hexdigest()
        assert (row["width"], row["height"]) == (160, 150)
        assert row["detectors"] == "centerface, pp-ocrv6-det-small"


def test_redactions_are_where_the_table_says(drive):
    out = run(drive)
    redactions = read_table(out / "redactions.parquet", "redactions").to_pylist()
    for row in read_table(out / "images.parquet", "images").to_pylist():
        mine = [r for r in redactions if (r["camera"], r["t_ns"]) == (row["camera"], row["t_ns"])]
        assert len(mine) == row["redactions"] > 0
        grey = cv2.imread(str(out / row["file"]), cv2.IMREAD_GRAYSCALE)
        mask = np.zeros(grey.shape, dtype=bool)
        for r in mine:
            mask[r["y_min"] : r["y_max"], r["x_min"] : r["x_max"]] = True
        assert (grey[mask] == FILL).all()
        assert row["redacted_pixels"] == mask.sum() > 60 * 60
    assert {r["kind"] for r in redactions} <= {"face", "plate"}


def test_bytes_do_not_depend_on_the_threads(drive):
    one, two = run(drive, "one", threads=1), run(drive, "two", threads=2)
    assert bytes_of(one) == bytes_of(two)


def test_recall_and_gates_are_stated(drive):
    # The face core in frame 0, and a "face" in a corner where there is none.
    label(drive, "camera_left,1000000000,face,54,45,110,95", "camera_left,1000000000,face,0,130,14,149")
    out = run(drive, gates=[GATE, PLATE_GATE])
    document = report_of(out)
    values = {figure["name"]: figure["value"] for figure in document["figures"]}
    assert values["recall_face_pct"] == 50
    assert 0 < values["recall_face_pct_low"] < 50
    assert values["recall_plate_pct"] is None
    assert [gate["verdict"] for gate in document["gates"]] == ["fail", "fail"]
    assert document["sequence"] == "town"
    assert set(document["inputs"]) == {"frames", "detections", "privacy_labels"}


def test_without_labels_the_gate_fails_closed_until_someone_signs(drive):
    out = run(drive, gates=[GATE])
    assert report_of(out)["gates"][0]["verdict"] == "fail"
    assert any("recall is unknown" in note for note in report_of(out)["notes"])
    signature = {"figure": "recall_face_pct", "signed_by": "J. Doe", "reason": "no people on the test track"}
    run(drive, gates=[GATE], overrides=[signature | {"sequences": ["another_drive"]}])
    assert report_of(out)["gates"][0]["verdict"] == "fail"
    run(drive, gates=[GATE], overrides=[signature | {"sequences": [report_of(out)["sequence"]]}])
    gate = report_of(out)["gates"][0]
    assert (gate["verdict"], gate["signed_by"]) == ("overridden", "J. Doe")


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:-700]), "truncated JPEG"),
        (lambda path: path.write_bytes(b""), "not a JPEG file"),
        (lambda path: path.unlink(), "image is missing"),
    ],
)
def test_one_bad_image_fails_the_stage_and_lets_nothing_out(drive, damage, message, threads):
    bad = drive / "camera_right" / "1100000011.jpg"
    damage(bad)
    with pytest.raises(CardError, match=f"{bad}: {message}"):
        run(drive, threads=threads)
    assert not any(path.is_file() for path in (drive.parents[1] / "results").rglob("*"))


def test_bad_label_row_is_found_before_any_work(drive):
    label(drive, "camera_left,1000000000,dog,1,1,2,2")
    with pytest.raises(CardError, match=r"privacy_labels.csv:2: unknown kind"):
        run(drive)


def test_frames_without_images_are_an_error(drive):
    empty = {name: [] for name in ("frame", "t_ns", "left_file", "right_file", "right_t_ns")}
    write_table(
        drive.parents[1] / "frames.parquet",
        empty | {"lidar_front_burst": [], "lidar_rear_burst": []},
        "frames",
    )
    with pytest.raises(CardError, match="no images to anonymize"):
        run(drive)


def test_without_a_detector_nothing_is_released(drive):
    with pytest.raises(CardError, match="no detector of faces and plates"):
        run(drive, embedded=False)
    assert not any(path.is_file() for path in (drive.parents[1] / "results").rglob("*"))


def test_a_detector_that_is_not_installed_is_an_error(drive, monkeypatch):
    monkeypatch.setattr("card.privacy.models.find_spec", lambda name: None)
    with pytest.raises(CardError, match="model of the embedded detector is missing"):
        run(drive)


def test_an_image_that_changed_after_the_search_is_refused(drive):
    out = run(drive)
    image = drive / "camera_left" / "1000000000.jpg"
    before = bytes_of(out)
    image.write_bytes((drive / "camera_left" / "1100000000.jpg").read_bytes())
    with pytest.raises(CardError, match="not the one that was searched"):
        anonymize(
            recording=drive,
            frames=drive.parents[1] / "frames.parquet",
            detections=out.parent / "privacy_search",
            sight={},
            labelled=drive / "privacy_labels.csv",
            reviews=drive / "privacy_review.csv",
            out=out,
            report=out.parent / "privacy.report.json",
            settings=default_settings("privacy"),
            gates=(),
            threads=1,
        )
    assert bytes_of(out) == before


def test_a_reviewer_adds_and_clears(drive):
    (drive / "privacy_review.csv").write_text(
        "camera,t_ns,action,kind,x_min,y_min,x_max,y_max,reason\n"
        "camera_left,1000000000,clear,face,-40,-40,199,189,a poster\n"
        "camera_left,1000000000,add,plate,2,130,30,140,half a plate\n"
    )
    out = run(drive)
    rows = read_table(out / "redactions.parquet", "redactions").to_pylist()
    mine = [row for row in rows if (row["camera"], row["t_ns"]) == ("camera_left", 10**9)]
    assert [row["source"] for row in mine if row["kind"] == "plate"] == ["review"]
    assert not [row for row in mine if row["kind"] == "face"]
    assert report_of(out)["counts"]["from_review"] == 1
    assert "privacy_review" in report_of(out)["inputs"]
