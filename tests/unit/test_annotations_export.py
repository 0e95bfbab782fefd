"""Handing frames out for labelling and training, and the commands of the loop."""

import json
from collections import Counter
from pathlib import Path

import pytest
import yaml
from labelling_loop import (
    ANNOTATIONS,
    PROPOSALS,
    detect,
    labels_of,
    make_loop,
    write_labels,
)

from card.annotations.import_labels import read_annotations, read_expected
from card.annotations.loop.export import export_for_labelling, export_for_training
from card.annotations.loop.sample import read_sample
from card.cli import main
from card.errors import CardError


@pytest.fixture(scope="module")
def work(tmp_path_factory) -> Path:
    return make_loop(tmp_path_factory.mktemp("loop"))


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
    labels = labels_of("drive_a")
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
    labels = labels_of("drive_a")
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
