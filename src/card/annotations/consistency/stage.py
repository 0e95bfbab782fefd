"""The consistency stage: a detector of the seed against the labels that it did not learn from."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.annotations.consistency.scene import Array, Scene
from card.annotations.consistency.table import as_markdown, consistency_rows
from card.annotations.loop.sample import SEED, TEST, VALIDATION, Sampled, split_figures
from card.artifacts import Figure, atomic_file, read_json, read_table, write_json, write_report
from card.errors import CardError

Row = tuple[Array, int, int, float]
"""Edges in px, image, class and confidence."""
TITLES = {VALIDATION: "Validation set", TEST: "Test set"}


def consistency(
    *,
    results: Path,
    sample: Path,
    rows: Sequence[Sampled],
    way: str,
    classes: Sequence[str],
    scores: Path,
    table: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write the paper's table of precision, recall and mean average precision by class.

    Paper, supplement, "Annotation Consistency Analysis".

    Parameters
    ----------
    results : folder with ``<id>/detections/<way>.parquet``, ``labels.parquet`` and ``ingest.report.json``.
    sample, rows : the sheet, for its hash, and its rows. way : ``random`` or ``grouped``.
    scores, table : document ``consistency`` and its Markdown to write.

    Raises
    ------
    CardError
        For a validation or test frame that nobody has reviewed.
    """
    document: dict[str, Any] = {"schema": "consistency", "way": way, "splits": {}}
    texts, figures = [], []
    for split, title in TITLES.items():
        keys = {(row.sequence, row.frame) for row in rows if row.part == SEED and getattr(row, way) == split}
        scored = consistency_rows(read_scene(results, sorted(keys), way, classes), classes)
        document["splits"][split] = {"frames": len(keys), "rows": scored}
        texts.append(as_markdown(f"{title}, {len(keys)} frames, {way} split", scored))
        figures.append(Figure(f"{split}_map50", scored[0]["map50"], "1", f"COCO mAP at IoU 0.5, {title}."))
    both = split_figures(rows, settings["near_frames"])
    document["sample"] = both
    texts.append(_ways(both))
    write_json(scores, document, "consistency")
    with atomic_file(table) as partial:
        partial.write_text("\n".join(texts), encoding="utf-8")
    write_report(
        report,
        stage="consistency",
        settings=settings,
        inputs={"sample": sample},
        counts={f"frames_{split}": document["splits"][split]["frames"] for split in TITLES},
        figures=figures,
        gates=gates,
    )


def read_scene(results: Path, keys: Sequence[tuple[str, int]], way: str, classes: Sequence[str]) -> Scene:
    """Labels and detections of the frames (sequence, frame), in px of their images."""
    image = {key: number for number, key in enumerate(keys)}
    parts: dict[str, list[Row]] = {"labels": [], "detections": []}
    for sequence in sorted({sequence for sequence, _ in keys}):
        folder = results / sequence
        counts = read_json(folder / "ingest.report.json", "report")["counts"]
        size = np.array([counts["camera_left_width_px"], counts["camera_left_height_px"]] * 2)
        _require_reviewed(folder, {frame for name, frame in keys if name == sequence})
        for schema, path in (("labels", "labels"), ("detections", f"detections/{way}")):
            for row in read_table(folder / f"{path}.parquet", schema).to_pylist():
                if (sequence, row["frame"]) in image:
                    number, name = image[sequence, row["frame"]], list(classes).index(row["class"])
                    parts[schema].append((_edges(row) * size, number, name, row.get("confidence", 1.0)))
    return Scene(*_columns(parts["detections"]), *_columns(parts["labels"])[:3])


def _columns(rows: Sequence[Row]) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
    edges, images, names, confidence = zip(*rows, strict=True) if rows else ((),) * 4
    return (
        np.array(edges, dtype=np.float64).reshape(-1, 4),
        np.array(images, dtype=np.int64),
        np.array(names, dtype=np.int64),
        np.array(confidence, dtype=np.float64),
    )


def _require_reviewed(folder: Path, frames: set[int]) -> None:
    states = read_table(folder / "label_states.parquet", "label_states").to_pylist()
    missing = sorted(r["frame"] for r in states if r["frame"] in frames and r["state"] == "not_reviewed")
    if missing:
        raise CardError("frame of the seed is not reviewed", where=f"{folder.name} {missing[0]}")


def _edges(row: Mapping[str, Any]) -> Array:
    x, y, width, height = (row[name] for name in ("x_center", "y_center", "width", "height"))
    return np.array([x - width / 2, y - height / 2, x + width / 2, y + height / 2])


def _ways(both: Mapping[str, Mapping[str, float]]) -> str:
    """Both ways of splitting the seed side by side."""
    lines = ["**Splits of the seed**", "", "| Split | Train | Validation | Test | Near a train frame |"]
    lines.append("|---|---:|---:|---:|---:|")
    for way, figures in both.items():
        cells = [
            f"{figures[f'{split}_frames']:.0f} ({figures[f'{split}_sequences']:.0f} seq.)"
            for split in ("train", "validation", "test")
        ]
        lines.append(f"| {way} | {' | '.join(cells)} | {figures['near_pct']:.0f} % |")
    return "\n".join([*lines, ""])
