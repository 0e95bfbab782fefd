"""Two small drives with labelled frames and a hand-made detector, for tests of the labelling loop."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from onnx_models import CELL, write_block_detector
from PIL import Image
from schema_rows import columns

from card.annotations.loop.propose import propose
from card.annotations.loop.sample import draw_sample, read_sample, write_sample
from card.artifacts import (
    default_settings,
    sha256_file,
    write_report,
    write_table,
)

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


def labels_of(drive: str) -> list[dict[str, Any]]:
    """Labels of all frames of a drive, in order."""
    return [label_row(frame, *cell) for frame in range(FRAMES) for cell in cells(drive, frame)]


def make_loop(work: Path) -> Path:
    """Results of both drives, all frames labelled; the detector finds every irregularity."""
    for drive in DRIVES:
        folder = work / "results" / drive
        frames, images = [], []
        for frame in range(FRAMES):
            t_ns = 1_000_000 + frame
            picture = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
            for name, column, row in cells(drive, frame):
                picture[row * CELL : (row + 1) * CELL, column * CELL : (column + 1) * CELL] = COLOURS[name]
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
        write_labels(folder, labels_of(drive))
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
