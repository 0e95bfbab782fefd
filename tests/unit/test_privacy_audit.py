"""The audit page, and the list of labelled irregularities that a redaction touches."""

import json

import cv2
import numpy as np
import pytest

from card.artifacts import read_table, write_report, write_table
from card.privacy.audit import audit

SIZE = 100, 80  # width, height
T_NS = 10**9


@pytest.fixture
def results(tmp_path):
    """One left image with a face redacted at columns 16..47 and rows 16..31."""
    folder = tmp_path / "town" / "anonymized"
    folder.mkdir(parents=True)
    cv2.imwrite(str(folder / "1.jpg"), np.full((SIZE[1], SIZE[0], 3), 90, np.uint8))
    image = {"camera": "camera_left", "t_ns": T_NS, "file": "1.jpg", "width": SIZE[0], "height": SIZE[1]}
    image |= {"redactions": 1, "redacted_pixels": 512, "sha256": "a", "source_sha256": "b", "detectors": "m"}
    write_table(folder / "images.parquet", {name: [value] for name, value in image.items()}, "images")
    box = {"camera": "camera_left", "t_ns": T_NS, "frame": 4, "kind": "face", "x_min": 16, "y_min": 16}
    box |= {"x_max": 48, "y_max": 32, "score": 1.0, "source": "m", "model_sha256": "c"}
    write_table(folder / "redactions.parquet", {name: [value] for name, value in box.items()}, "redactions")
    write_report(
        tmp_path / "town" / "privacy.report.json",
        stage="privacy",
        settings={},
        inputs={},
        counts={"images": 1},
    )
    return tmp_path / "town"


def label(results, *boxes: tuple[int, float, float, float, float]) -> None:
    """Labels as (frame, x_min, y_min, x_max, y_max), edges in px with pixel centres at integers."""
    frames, *edges = map(np.array, zip(*boxes, strict=True)) if boxes else [np.zeros(0)] * 5
    x_min, y_min, x_max, y_max = edges
    columns = {
        "frame": frames.astype(np.int32),
        "class": ["positive"] * len(boxes),
        "x_center": ((x_min + x_max) / 2 + 0.5) / SIZE[0],
        "y_center": ((y_min + y_max) / 2 + 0.5) / SIZE[1],
        "width": (x_max - x_min) / SIZE[0],
        "height": (y_max - y_min) / SIZE[1],
    }
    write_table(results / "labels.parquet", columns, "labels")


def run(results) -> list[dict]:
    audit(
        anonymized=results / "anonymized",
        labels=results / "labels.parquet",
        privacy_report=results / "privacy.report.json",
        out=results / "audit",
        settings={"samples": 3},
    )
    return read_table(
        results / "audit" / "redacted_irregularities.parquet", "redacted_irregularities"
    ).to_pylist()


def test_lists_labels_that_a_redaction_touches_with_the_share(results):
    label(results, (4, 31.5, 15.5, 63.5, 31.5), (4, 60.5, 40.5, 70.5, 50.5), (5, 15.5, 15.5, 47.5, 31.5))
    (row,) = run(results)
    assert (row["frame"], row["t_ns"], row["class"], row["sources"]) == (4, T_NS, "positive", "m")
    assert row["redacted_share"] == pytest.approx(0.5)
    assert (row["x_min"], row["x_max"]) == pytest.approx((31.5, 63.5))


def test_the_page_shows_the_released_image_and_what_found_the_boxes(results):
    label(results)
    assert run(results) == []
    page = (results / "audit" / "index.html").read_text()
    assert page.count("<img") == 1
    assert "camera_left 1000000000: 1 boxes" in page
    assert "<td>face</td><td>m</td><td>1</td>" in page
    assert "http" not in page


def test_same_input_same_bytes(results):
    label(results, (4, 31.5, 15.5, 63.5, 31.5))
    run(results)
    before = {path.name: path.read_bytes() for path in (results / "audit").iterdir()}
    run(results)
    assert before == {path.name: path.read_bytes() for path in (results / "audit").iterdir()}
    assert json.loads((results / "privacy.report.json").read_text())["stage"] == "privacy"
