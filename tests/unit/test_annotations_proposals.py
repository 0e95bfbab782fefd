"""What the detector proposes, how persons correct it, and how consistent labels are."""

from collections import Counter
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from labelling_loop import (
    ANNOTATIONS,
    DRIVES,
    FRAMES,
    PROPOSALS,
    cells,
    detect,
    label_row,
    labels_of,
    make_loop,
    write_labels,
)

from card.annotations.consistency.stage import consistency
from card.annotations.loop.review import compare, review_proposals
from card.annotations.loop.sample import read_sample
from card.artifacts import (
    read_json,
    read_table,
    sha256_file,
)
from card.errors import CardError


@pytest.fixture(scope="module")
def work(tmp_path_factory) -> Path:
    return make_loop(tmp_path_factory.mktemp("loop"))


def test_detections_are_of_frames_that_were_not_trained_on(work):
    for way in ("random", "grouped"):
        found = read_table(detect(work, "drive_a", way), "detections").to_pylist()
        rows = [row for row in read_sample(work / "sample.tsv") if row.sequence == "drive_a"]
        assert {row["frame"] for row in found} == {row.frame for row in rows if getattr(row, way) != "train"}
    sure = [row for row in found if row["confidence"] > 0.5]
    for row in sure:
        assert any(
            row[name] == pytest.approx(wanted[name])
            for wanted in (label_row(row["frame"], *cell) for cell in cells("drive_a", row["frame"]))
            for name in ("x_center", "y_center")
        )
    report = read_json(work / "results/drive_a/detections/random.report.json", "report")
    assert report["inputs"]["model"] == sha256_file(work / "blocks.onnx")
    assert report["inputs"]["sample"] == sha256_file(work / "sample.tsv")


def test_a_model_with_another_hash_leaves_nothing(work, tmp_path):
    path = work / "results" / "drive_b" / "detections" / "grouped.parquet"
    with pytest.raises(CardError, match="another hash"):
        detect(work, "drive_b", "grouped", sha256="0" * 64)
    assert not path.exists()


def test_review_tells_accepted_moved_deleted_and_added(work):
    detect(work, "drive_a")
    folder = work / "results" / "drive_a"
    rows = [asdict(row) for row in read_sample(work / "sample.tsv") if row.sequence == "drive_a"]
    rest = [row["frame"] for row in rows if row["part"] == "rest"]
    accepted, moved, deleted, added, unseen = rest[:5]
    labels = []
    for frame in range(FRAMES):
        first, second = cells("drive_a", frame)
        labels.append(label_row(frame, *first, shift_px=6 if frame == moved else 0.4))
        labels += [label_row(frame, *second)] if frame != deleted else []
    used = {(column, row) for _, column, row in cells("drive_a", added)}
    column, row = next((k % 4, k // 4) for k in range(12) if (k % 4, k // 4) not in used)
    labels.append(label_row(added, "positive", column, row))
    kept = [row for row in labels if row["frame"] != unseen]
    write_labels(folder, sorted(kept, key=lambda row: row["frame"]), (unseen,))
    try:
        review_proposals(
            detections=folder / "detections" / "random.parquet",
            detections_report=folder / "detections" / "random.report.json",
            labels=folder / "labels.parquet",
            label_states=folder / "label_states.parquet",
            ingest_report=folder / "ingest.report.json",
            rows=rows,
            review=folder / "detections" / "random-review.parquet",
            report=folder / "detections" / "random-review.report.json",
            settings={name: PROPOSALS[name] for name in ("proposal_confidence", "moved_iou", "same_px")},
            gates=[],
        )
    finally:
        labels = labels_of("drive_a")
        write_labels(folder, labels)
    table = read_table(folder / "detections" / "random-review.parquet", "proposal_review").to_pylist()
    outcomes = {frame: Counter(r["outcome"] for r in table if r["frame"] == frame) for frame in rest}
    assert outcomes[accepted] == {"accepted": 2}
    assert outcomes[moved] == {"accepted": 1, "moved": 1}
    assert outcomes[deleted] == {"accepted": 1, "deleted": 1}
    assert outcomes[added] == {"accepted": 2, "added": 1}
    assert outcomes[unseen] == {}
    (line,) = [r for r in table if r["outcome"] == "moved"]
    assert line["moved_px"] == pytest.approx(6, abs=0.01)
    report = read_json(folder / "detections" / "random-review.report.json", "report")
    assert report["counts"]["frames_reviewed"] == len(rest) - 1
    assert report["notes"] == [
        f"model {sha256_file(work / 'blocks.onnx')}",
        f"sample {sha256_file(work / 'sample.tsv')}",
    ]


def test_a_label_of_another_class_is_no_moved_proposal():
    size = np.array([100.0, 100.0] * 2)
    box = {"x_center": 0.5, "y_center": 0.5, "width": 0.2, "height": 0.2}
    lines = compare(
        [box | {"class": "positive", "confidence": 0.9}], [box | {"class": "negative"}], size, PROPOSALS
    )
    assert [line["outcome"] for line in lines] == ["deleted", "added"]


def test_consistency_of_a_perfect_detector(work):
    for drive in DRIVES:
        detect(work, drive)
    out = work / "results" / "annotations"
    rows = read_sample(work / "sample.tsv")
    consistency(
        results=work / "results",
        sample=work / "sample.tsv",
        rows=rows,
        way="random",
        classes=ANNOTATIONS["classes"],
        scores=out / "consistency-random.json",
        table=out / "consistency-random.md",
        report=out / "consistency-random.report.json",
        settings={"near_frames": 10},
        gates=[],
    )
    document = read_json(out / "consistency-random.json", "consistency")
    for split in ("validation", "test"):
        total = document["splits"][split]["rows"][0]
        frames = sum(row.random == split for row in rows)
        assert total["instances"] == 2 * frames
        assert (total["map50"], total["precision"]) == (pytest.approx(1), pytest.approx(1))
    text = (out / "consistency-random.md").read_text()
    assert "**Validation set" in text
    assert "| grouped |" in text
