"""Folders for a label tool and for a training tool, with anonymized images."""

import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from card.annotations.boxes import Box
from card.annotations.formats import FORMATS, yolo
from card.annotations.formats.expected import Expected
from card.annotations.import_labels import NOT_REVIEWED, read_expected
from card.annotations.loop.images import LEFT, LeftImage, left_images
from card.annotations.loop.sample import SEED, SPLITS, Sampled
from card.artifacts import atomic_folder, read_table
from card.errors import CardError

TRAINING_FOLDERS = dict(zip(SPLITS, ("train", "val", "test"), strict=True))


class Labelled:
    """What an export needs of one sequence under ``results/<id>``."""

    def __init__(self, results: Path, name: str, settings: Mapping[str, Any]) -> None:
        self.name = name
        self._folder = results / name
        frames = self._folder / "frames.parquet"
        self.images = left_images(self._folder / "anonymized" / "images.parquet", frames)
        self.expected: Expected = read_expected(frames, self._folder / "ingest.report.json", settings)

    def reviewed(self) -> dict[int, list[Box]]:
        """Labels of the frames that a person has looked at."""
        states = read_table(self._folder / "label_states.parquet", "label_states").to_pylist()
        boxes: dict[int, list[Box]] = {r["frame"]: [] for r in states if r["state"] != NOT_REVIEWED}
        for row in read_table(self._folder / "labels.parquet", "labels").to_pylist():
            boxes[row["frame"]].append(_box(row))
        return boxes

    def proposed(self, way: str, confidence: float) -> dict[int, list[Box]]:
        """Proposals from a confidence on; none where no detector has run."""
        path = self._folder / "detections" / f"{way}.parquet"
        boxes: dict[int, list[Box]] = {}
        for row in read_table(path, "detections").to_pylist() if path.is_file() else []:
            if row["confidence"] >= confidence:
                boxes.setdefault(row["frame"], []).append(_box(row))
        return boxes

    def image(self, frame: int) -> LeftImage:
        """The anonymized left image of a frame."""
        if frame not in self.images:
            raise CardError("frame has no anonymized image", where=self.name, found=frame)
        return self.images[frame]


def export_for_labelling(
    *,
    results: Path,
    sample: Iterable[Sampled],
    part: str,
    form: str,
    way: str,
    out: Path,
    annotations: Mapping[str, Any],
    proposals: Mapping[str, Any],
) -> dict[str, int]:
    """Write ``out/<id>/``: images of one part of the sample, and labels or proposals in a tool's format.

    A frame that a person has reviewed comes with its labels, another with its proposals, if there are any.
    Put what the tool makes of a folder, without the images, into ``recordings/<id>/annotations/``.

    Parameters
    ----------
    part : ``seed`` or ``rest``. form : a key of ``FORMATS``. way : split whose detector made the proposals.
    annotations, proposals : settings of the stages of these names.

    Returns
    -------
    Counts: images, reviewed frames, frames with proposals.
    """
    counts = {"images": 0, "reviewed": 0, "proposed": 0}
    with atomic_folder(out) as folder:
        for name, rows in _by_sequence(row for row in sample if row.part == part).items():
            source = Labelled(results, name, annotations)
            reviewed = source.reviewed()
            proposed = source.proposed(way, proposals["proposal_confidence"])
            target = folder / name
            (target / LEFT).mkdir(parents=True)
            labels: dict[str, list[Box]] = {}
            offers: dict[str, list[Box]] = {}
            for row in rows:
                path = source.image(row.frame).verified()
                shutil.copyfile(path, target / LEFT / path.name)
                if row.frame in reviewed:
                    labels[f"{LEFT}/{path.name}"] = reviewed[row.frame]
                elif row.frame in proposed:
                    offers[f"{LEFT}/{path.name}"] = proposed[row.frame]
            FORMATS[form].offer(target, labels, offers, source.expected)
            counts["images"] += len(rows)
            counts["reviewed"] += len(labels)
            counts["proposed"] += len(offers)
    return counts


def export_for_training(
    *, results: Path, sample: Iterable[Sampled], way: str, out: Path, annotations: Mapping[str, Any]
) -> dict[str, int]:
    """Write images and labels of the seed as YOLO training tools take them, split one of both ways.

    ``out/data.yaml``, ``out/images/{train,val,test}/<id>-<t_ns>.jpg`` and ``out/labels/...txt`` alike.

    Raises
    ------
    CardError
        While frames of the seed are not reviewed: a frame without labels would be learned as one without
        irregularities.
    """
    counts = dict.fromkeys(TRAINING_FOLDERS.values(), 0)
    with atomic_folder(out) as folder:
        for kind in ("images", "labels"):
            for split in counts:
                (folder / kind / split).mkdir(parents=True)
        for name, rows in _by_sequence(row for row in sample if row.part == SEED).items():
            source = Labelled(results, name, annotations)
            reviewed = source.reviewed()
            missing = [row.frame for row in rows if row.frame not in reviewed]
            if missing:
                raise CardError(
                    "frames of the seed are not reviewed",
                    where=name,
                    found=f"{len(missing)}, the first is {missing[0]}",
                    wanted="all of them labelled and imported",
                )
            for row in rows:
                split = TRAINING_FOLDERS[getattr(row, way)]
                path = source.image(row.frame).verified()
                stem = f"{name}-{path.stem}"
                shutil.copyfile(path, folder / "images" / split / f"{stem}{path.suffix}")
                text = yolo.lines(reviewed[row.frame], annotations["classes"])
                (folder / "labels" / split / f"{stem}.txt").write_text(text, encoding="utf-8")
                counts[split] += 1
        (folder / "data.yaml").write_text(_data_yaml(annotations["classes"]), encoding="utf-8")
    return counts


def _data_yaml(classes: Sequence[str]) -> str:
    folders = "".join(f"{split}: images/{split}\n" for split in TRAINING_FOLDERS.values())
    return folders + "names:\n" + "".join(f"  {number}: {name}\n" for number, name in enumerate(classes))


def _by_sequence(rows: Iterable[Sampled]) -> dict[str, list[Sampled]]:
    groups: dict[str, list[Sampled]] = {}
    for row in sorted(rows):
        groups.setdefault(row.sequence, []).append(row)
    return groups


def _box(row: Mapping[str, Any]) -> Box:
    return Box(row["class"], row["x_center"], row["y_center"], row["width"], row["height"], 0)
