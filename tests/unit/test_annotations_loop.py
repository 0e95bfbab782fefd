"""The labelling loop on two small drives with a hand-made detector: sample, export, propose, review."""

import json
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from onnx_models import CELL, write_block_detector
from PIL import Image
from schema_rows import columns

from card.annotations.consistency.stage import consistency
from card.annotations.import_labels import read_annotations, read_expected
from card.annotations.loop.choose import read_frames
from card.annotations.loop.export import export_for_labelling, export_for_training
from card.annotations.loop.propose import propose
from card.annotations.loop.review import compare, review_proposals
from card.annotations.loop.sample import draw_sample, read_sample, split_figures, write_sample
from card.artifacts import (
    default_settings,
    read_json,
    read_table,
    sha256_file,
    write_report,
    write_table,
)
from card.cli import main
from card.errors import CardError

ANNOTATIONS, PROPOSALS = default_settings("annotations"), default_settings("proposals")
SIZE = 4 * CELL, 3 * CELL
DRIVES, FRAMES = ("drive_a", "drive_b"), 20
COLOURS = {"positive": (255, 0, 0), "negative": (0, 255, 0)}


def cells(drive: str, frame: int) -> list[tuple[str, int, int]]:
    """The irregularities of a frame: class, column and row of the cell."""
    rng = np.random.default_rng([DRIVES.index(drive), frame])
    places = rng.permutation(12)[:2].tolist()
    return [(str(rng.choice(list(COLOURS))), place % 4, place // 4) for place in places]


def label_row(frame: int, name: str, column: int, row: int, shift_px: float = 0.0) -> dict[str, Any]:
    return {
        "frame": frame,
        "class": name,
        "x_center": (CELL * (column + 0.5) + shift_px) / SIZE[0],
        "y_center": CELL * (row + 0.5) / SIZE[1],
        "width": CELL / SIZE[0],
        "height": CELL / SIZE[1],
    }


@pytest.fixture(scope="module")
def work(tmp_path_factory) -> Path:
    """Results of both drives, all frames labelled; the detector finds every irregularity."""
    work = tmp_path_factory.mktemp("loop")
    for drive in DRIVES:
        folder = work / "results" / drive
        frames, images, labels = [], [], []
        for frame in range(FRAMES):
            t_ns = 1_000_000 + frame
            picture = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
            for name, column, row in cells(drive, frame):
                picture[row * CELL : (row + 1) * CELL, column * CELL : (column + 1) * CELL] = COLOURS[name]
                labels.append(label_row(frame, name, column, row))
            path = folder / "anonymized" / "camera_left" / f"{t_ns}.jpg"
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(picture).save(path, quality=95)
            frames.append({"frame": frame, "t_ns": t_ns, "left_file": f"camera_left/{t_ns}.jpg"})
            images.append(
                {
                    "camera": "camera_left",
                    "t_ns": t_ns,
                    "file": f"camera_left/{t_ns}.jpg",
                    "width": SIZE[0],
                    "height": SIZE[1],
                    "sha256": sha256_file(path),
                }
            )
        write_table(folder / "frames.parquet", columns("frames", frames), "frames")
        write_table(folder / "anonymized" / "images.parquet", columns("images", images), "images")
        write_labels(folder, labels)
        size = {"camera_left_width_px": SIZE[0], "camera_left_height_px": SIZE[1]}
        write_report(folder / "ingest.report.json", stage="ingest", settings={}, inputs={}, counts=size)
    write_block_detector(work / "blocks.onnx")
    every = [(drive, frame) for drive in DRIVES for frame in range(FRAMES)]
    write_sample(work / "sample.tsv", draw_sample(every, PROPOSALS))
    return work


def write_labels(folder: Path, labels: list[dict[str, Any]], unseen: tuple[int, ...] = ()) -> None:
    there = {row["frame"] for row in labels}
    states = {
        frame: "not_reviewed" if frame in unseen else "boxes" if frame in there else "reviewed_none"
        for frame in range(FRAMES)
    }
    write_table(folder / "labels.parquet", columns("labels", labels), "labels")
    table = {"frame": list(states), "state": list(states.values())}
    write_table(folder / "label_states.parquet", table, "label_states")


def detect(work: Path, drive: str, way: str = "random", **changes: Any) -> Path:
    folder = work / "results" / drive
    detector = PROPOSALS["detectors"][way] | {
        "model": str(work / "blocks.onnx"),
        "sha256": sha256_file(work / "blocks.onnx"),
        "license": "CC0-1.0",
        "input": "native",
    }
    rows = [asdict(row) for row in read_sample(work / "sample.tsv") if row.sequence == drive]
    propose(
        images=folder / "anonymized" / "images.parquet",
        frames=folder / "frames.parquet",
        sample=work / "sample.tsv",
        rows=rows,
        way=way,
        detector=detector | changes,
        detections=folder / "detections" / f"{way}.parquet",
        report=folder / "detections" / f"{way}.report.json",
        settings={name: PROPOSALS[name] for name in ("least_confidence", "nms_iou")},
        gates=[],
        sequence=drive,
    )
    return folder / "detections" / f"{way}.parquet"


def test_the_sample_is_the_papers_and_can_be_repeated():
    frames = [(f"drive_{k}", frame) for k in range(9) for frame in range(50 + 10 * k)]
    sample = draw_sample(frames, PROPOSALS)
    assert sample == draw_sample(reversed(frames + frames[:3]), PROPOSALS)
    assert sample != draw_sample(frames, PROPOSALS | {"seed": 2})
    seed = [row for row in sample if row.part == "seed"]
    assert len(sample) == len(frames)
    assert len(seed) == round(0.4 * len(frames))
    assert Counter(row.random for row in seed) == {
        "train": round(0.7 * len(seed)),
        "validation": round(0.2 * len(seed)),
        "test": len(seed) - round(0.7 * len(seed)) - round(0.2 * len(seed)),
    }
    assert {(row.random, row.grouped) for row in sample if row.part == "rest"} == {("-", "-")}


def test_grouped_splits_keep_sequences_whole_and_near_their_shares():
    frames = [(f"drive_{k}", frame) for k in range(30) for frame in range(40 + 5 * k)]
    sample = draw_sample(frames, PROPOSALS)
    seed = [row for row in sample if row.part == "seed"]
    for k in range(30):
        assert len({row.grouped for row in seed if row.sequence == f"drive_{k}"}) == 1
    shares = Counter(row.grouped for row in seed)
    assert shares["train"] / len(seed) == pytest.approx(0.7, abs=0.03)
    assert shares["validation"] / len(seed) == pytest.approx(0.2, abs=0.03)
    figures = split_figures(sample, 10)
    assert figures["grouped"]["near_pct"] == 0
    assert figures["random"]["near_pct"] > 95
    assert figures["random"]["train_frames"] == round(0.7 * len(seed))
    assert figures["grouped"]["train_sequences"] < 30 == figures["random"]["train_sequences"]


def test_a_drawn_sample_is_not_drawn_over(work, tmp_path):
    path = tmp_path / "sample.tsv"
    sample = read_sample(work / "sample.tsv")
    write_sample(path, sample)
    assert path.read_bytes() == (work / "sample.tsv").read_bytes()
    write_sample(path, sample)
    with pytest.raises(CardError, match="another sample was drawn before"):
        write_sample(path, sample[1:])


def test_a_listed_frame_must_be_there(work, tmp_path):
    (tmp_path / "list.tsv").write_text(f"sequence\tframe\ndrive_a\t3\ndrive_a\t{FRAMES}\n")
    with pytest.raises(CardError, match=r"list.tsv: unknown frame \(found drive_a 20\)"):
        read_frames(tmp_path / "list.tsv", work / "results")


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


def test_only_the_anonymized_image_is_looked_at_or_handed_out(work, tmp_path):
    path = sorted((work / "results/drive_b/anonymized/camera_left").iterdir())[0]
    content = path.read_bytes()
    arguments = {"results": work / "results", "sample": read_sample(work / "sample.tsv")}
    arguments |= {"annotations": ANNOTATIONS, "out": tmp_path / "out"}
    path.write_bytes(content + b"\0")
    try:
        for part in ("seed", "rest"):
            labelling = {"part": part, "form": "yolo", "way": "random", "proposals": PROPOSALS}
            rows = read_sample(work / "sample.tsv")
            row = next(r for r in rows if (r.sequence, r.frame) == ("drive_b", 0))
            if row.part == part:
                with pytest.raises(CardError, match="image is not the anonymized one"):
                    export_for_labelling(**arguments, **labelling)
        assert not (tmp_path / "out").exists()
    finally:
        path.write_bytes(content)


@pytest.mark.parametrize("form", ["yolo", "voc", "coco", "cvat", "label_studio"])
def test_what_is_exported_can_be_imported_as_it_is(work, tmp_path, form):
    detect(work, "drive_a")
    detect(work, "drive_b")
    sample = read_sample(work / "sample.tsv")
    folder = work / "results" / "drive_a"
    rest = [row.frame for row in sample if row.sequence == "drive_a" and row.part == "rest"]
    labels = [label_row(frame, *cell) for frame in range(FRAMES) for cell in cells("drive_a", frame)]
    unseen = tuple(rest[2:])
    write_labels(folder, [row for row in labels if row["frame"] not in unseen], unseen)
    try:
        counts = export_for_labelling(
            results=work / "results",
            sample=sample,
            part="rest",
            form=form,
            way="random",
            out=tmp_path / "out",
            annotations=ANNOTATIONS,
            proposals=PROPOSALS,
        )
    finally:
        write_labels(folder, labels)
    assert counts["images"] == len([row for row in sample if row.part == "rest"])
    assert counts["proposed"] == len(unseen)
    assert len(list((tmp_path / "out/drive_a/camera_left").glob("*.jpg"))) == len(rest)
    expected = read_expected(folder / "frames.parquet", folder / "ingest.report.json", ANNOTATIONS)
    boxes, _, issues = read_annotations(tmp_path / "out" / "drive_a", expected, form)
    assert issues == []
    # Label Studio keeps proposals apart; elsewhere they are what a person corrects.
    assert set(boxes) == set(rest[:2] if form == "label_studio" else rest)
    if form == "label_studio":
        tasks = json.loads((tmp_path / "out/drive_a/annotations.json").read_text())
        assert sum(bool(task.get("predictions")) for task in tasks) == len(unseen)
    for frame in boxes:
        assert len(boxes[frame]) == 2


def test_training_folders_hold_the_seed_by_split(work, tmp_path):
    sample = read_sample(work / "sample.tsv")
    arguments = {"results": work / "results", "sample": sample, "annotations": ANNOTATIONS}
    for way in ("random", "grouped"):
        counts = export_for_training(way=way, out=tmp_path / way, **arguments)
        wanted = Counter(getattr(row, way) for row in sample if row.part == "seed")
        assert counts == {
            "train": wanted["train"],
            "val": wanted["validation"],
            "test": wanted["test"],
        }
    data = yaml.safe_load((tmp_path / "random" / "data.yaml").read_text())
    assert data["names"] == {0: "positive", 1: "negative"}
    for split in ("train", "val", "test"):
        images = sorted(path.stem for path in (tmp_path / "random" / data[split]).iterdir())
        texts = sorted(path.stem for path in (tmp_path / "random" / "labels" / split).iterdir())
        assert images == texts


def test_training_waits_for_the_whole_seed(work, tmp_path):
    sample = read_sample(work / "sample.tsv")
    folder = work / "results" / "drive_a"
    seed = [row.frame for row in sample if row.sequence == "drive_a" and row.part == "seed"]
    labels = [label_row(frame, *cell) for frame in range(FRAMES) for cell in cells("drive_a", frame)]
    write_labels(folder, [row for row in labels if row["frame"] != seed[1]], (seed[1],))
    try:
        with pytest.raises(CardError, match=rf"drive_a: .*not reviewed \(found 1, the first is {seed[1]}"):
            export_for_training(
                results=work / "results",
                sample=sample,
                way="random",
                out=tmp_path / "out",
                annotations=ANNOTATIONS,
            )
    finally:
        write_labels(folder, labels)
    assert not (tmp_path / "out").exists()


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
        labels = [label_row(frame, *cell) for frame in range(FRAMES) for cell in cells("drive_a", frame)]
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


def test_a_model_with_another_hash_leaves_nothing(work, tmp_path):
    path = work / "results" / "drive_b" / "detections" / "grouped.parquet"
    with pytest.raises(CardError, match="another hash"):
        detect(work, "drive_b", "grouped", sha256="0" * 64)
    assert not path.exists()


def test_commands(work, tmp_path, capsys):
    config = tmp_path / "config.yaml"
    config.write_text(yaml.safe_dump({"proposals": {"sample": str(tmp_path / "sample.tsv")}}))
    common = ["--config", str(config), "--results", str(work / "results")]
    frames = str(tmp_path / "frames.tsv")
    assert main(["annotations", "choose", frames, *common]) == 0
    assert main(["annotations", "sample", frames, *common]) == 0
    assert (tmp_path / "sample.tsv").read_bytes() == (work / "sample.tsv").read_bytes()
    text = capsys.readouterr().out
    assert "16 of 40 frames are the seed" in text
    assert "near a train frame" in text
    out = str(tmp_path / "out")
    assert main(["annotations", "export", out, "--part", "seed", "--format", "cvat", *common]) == 0
    assert (tmp_path / "out" / "drive_a" / "annotations.xml").is_file()
    assert main(["annotations", "export", out, "--training", "grouped", *common]) == 0
    assert (tmp_path / "out" / "data.yaml").is_file()
    (tmp_path / "sample.tsv").unlink()
    assert main(["annotations", "export", out, "--part", "rest", *common]) == 1
    assert "card: " in capsys.readouterr().err
