"""Recall of the privacy stage against every face and plate that the simulated cameras saw."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from card.artifacts import default_settings, read_table
from card.privacy.recall import LabelledObject, recall_figures
from card.privacy.redaction import Area

AIM_PCT = 99.0


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Rows `recall_face_pct`, `recall_plate_pct` and their lower bounds `_low`, all sequences together.

    work : folder with `results/<id>/anonymized`; truth : folder with `<id>/boxes.parquet`.
    A sequence without images is left out.
    """
    settings = default_settings("privacy")
    objects: list[LabelledObject] = []
    areas: dict[tuple[str, int], list[Area]] = defaultdict(list)
    sizes: dict[tuple[str, int], tuple[int, int]] = {}
    for sequence in sequences:
        folder = work / "results" / sequence / "anonymized"
        if not folder.is_dir():
            continue
        for row in read_table(folder / "images.parquet", "images").to_pylist():
            sizes[f"{sequence}/{row['camera']}", row["t_ns"]] = (row["width"], row["height"])
        for row in read_table(folder / "redactions.parquet", "redactions").to_pylist():
            area = (row["x_min"], row["y_min"], row["x_max"], row["y_max"])
            areas[f"{sequence}/{row['camera']}", row["t_ns"]].append(area)
        for row in read_table(truth / sequence / "boxes.parquet", "truth_boxes").to_pylist():
            image = (f"{sequence}/{row['camera']}", row["t_ns"])
            if row["kind"] in ("face", "plate") and image in sizes:
                edges = (row[edge] for edge in ("x_min", "y_min", "x_max", "y_max"))
                objects.append(LabelledObject(image, row["kind"], *edges))
    figures = recall_figures(
        objects,
        areas,
        sizes,
        covered_share_wanted=settings["covered_share"],
        confidence=settings["confidence"],
        where=truth,
    )
    return [
        {
            "stage": "privacy",
            "figure": figure.name,
            "value": figure.value,
            "unit": figure.unit,
            "aim": AIM_PCT,
            "better": "higher",
        }
        for figure in figures
    ]
