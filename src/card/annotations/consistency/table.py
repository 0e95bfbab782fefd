"""The paper's table of a detector's figures by class."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from card.annotations.consistency.coco import coco_precision
from card.annotations.consistency.curves import SEMANTICS, Matches, average_precision, match
from card.annotations.consistency.scene import Scene

ALL = "all"
COLUMNS = ("precision", "recall", "map50", "map50_95", "map50_interpolated", "map50_95_interpolated")
HEADS = ("Precision", "Recall", "mAP@.50", "mAP@.50–.95", "mAP@.50 i.", "mAP@.50–.95 i.")


def consistency_rows(scene: Scene, classes: Sequence[str]) -> list[dict[str, Any]]:
    """One row a class, all classes first: instances, `COLUMNS`; None where a class has no labels.

    Precision and recall are those at IoU 0.5 and at the one confidence where the mean F1 of the classes is
    largest. ``map50`` and ``map50_95`` are COCO's, by pycocotools; ``_interpolated`` names the other
    semantics (see ``curves``), which is that of the paper's tool.
    """
    numbers = range(len(classes))
    matches = [match(scene, number, "coco") for number in numbers]
    confidence = best_confidence(matches)
    coco = coco_precision(scene, len(classes))
    interpolated = np.array([average_precision(match(scene, n, SEMANTICS[1]), SEMANTICS[1]) for n in numbers])
    rows: list[dict[str, Any]] = []
    for number, name in enumerate(classes):
        areas = [mean for ap in (coco[number], interpolated[number]) for mean in (ap[0], ap.mean())]
        values = zip(COLUMNS, (*at_confidence(matches[number], confidence), *areas), strict=True)
        rows.append({"class": name, "instances": matches[number].labels, **_plain(dict(values))})
    total: dict[str, Any] = {"class": ALL, "instances": sum(row["instances"] for row in rows)}
    for column in COLUMNS:
        known = [row[column] for row in rows if row[column] is not None]
        total[column] = float(np.mean(known)) if known else None
    return [total, *rows]


def best_confidence(matches: Sequence[Matches]) -> float:
    """The confidence at which the mean F1 of the classes with labels is largest, at IoU 0.5."""
    labelled = [one for one in matches if one.labels]
    candidates = np.unique(np.concatenate([np.ones(1), *(one.confidence for one in labelled)]))
    scores = np.zeros(len(candidates))
    for one in labelled:
        # Detections as sure as the candidate or surer.
        taken = np.searchsorted(-one.confidence, -candidates, side="right")
        hits = np.concatenate([[0], np.cumsum(one.hit[0])])[taken]
        scores += 2 * hits / (taken + one.labels)
    return float(candidates[len(candidates) - 1 - int(np.argmax(scores[::-1]))])


def at_confidence(matches: Matches, confidence: float) -> tuple[float, float]:
    """Precision and recall at IoU 0.5 of detections from a confidence on; NaN where undefined."""
    taken = int(np.searchsorted(-matches.confidence, -confidence, side="right"))
    hits = int(matches.hit[0, :taken].sum())
    recall = hits / matches.labels if matches.labels else np.nan
    return (hits / taken if taken else np.nan), recall


def as_markdown(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as a table in the paper's form."""
    head = ["Class", "Instances", *HEADS]
    lines = [f"| {' | '.join(head)} |", f"|{'---|' + '---:|' * (len(head) - 1)}"]
    for row in rows:
        name = "All classes" if row["class"] == ALL else row["class"].capitalize()
        values = ["–" if row[column] is None else f"{row[column]:.3f}" for column in COLUMNS]
        cells = [name, format(row["instances"], ","), *values]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([f"**{title}**", "", *lines, ""])


def _plain(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: None if np.isnan(value) else float(value) for name, value in values.items()}
