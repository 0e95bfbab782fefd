"""Recall of the privacy stage: against every face and plate the simulated cameras saw, and on real faces."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from linkage import PEOPLE, blurred, filled, linked_pct
from numpy.typing import NDArray

from card.artifacts import default_settings, read_table
from card.privacy.centerface import CenterFaceDetector
from card.privacy.recall import LabelledObject, recall_figures
from card.privacy.redaction import Area

AIM_PCT = 99.0
# Heights, px from hair to chin, at which real faces are shown.
REAL_FACE_PX = (12, 16, 24, 48, 96)


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Rows `recall_face_pct`, `recall_plate_pct`, by height and with lower bounds `_low`; real faces.

    work : folder with `results/<id>/anonymized`; truth : folder with `<id>/boxes.parquet`.
    A sequence without images is left out.
    """
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
        objects, areas, sizes, settings=default_settings("privacy")["recall"], where=truth
    )
    simulated = [
        _row(figure.name, figure.value, AIM_PCT if figure.name.endswith(("_pct", "_low")) else None)
        for figure in figures
    ]
    real = [_row(f"recall_real_face_pct_{px}px", real_face_recall(px), None) for px in REAL_FACE_PX]
    linkage = [
        _row("linkage_fill_pct", linked_pct(filled), 100 / PEOPLE, "lower"),
        _row("linkage_blur_pct", linked_pct(blurred), None, "lower"),
    ]
    return simulated + real + linkage


def real_face_recall(height_px: int) -> float:
    """Percent of 100 photographed people whose face is covered whole when it is ``height_px`` high.

    The people are those of Labeled Faces in the Wild that scikit-image ships, shown in a photograph of a
    street's size without people.
    """
    from skimage import data

    settings = default_settings("privacy")
    detector = CenterFaceDetector(settings["face"], settings["tile_px"], settings["tile_overlap_px"])
    faces = (255 * data.lfw_subset()[:100]).astype(np.uint8)
    covered = 0
    for start in range(0, len(faces), 20):
        scene, boxes = _crowd(faces[start : start + 20], height_px)
        found = detector.detect(scene)
        covered += sum(
            any(d.x_min <= b[0] and d.y_min <= b[1] and d.x_max >= b[2] and d.y_max >= b[3] for d in found)
            for b in boxes
        )
    return 100.0 * covered / len(faces)


def _crowd(
    faces: NDArray[np.uint8], height_px: int
) -> tuple[NDArray[np.uint8], list[tuple[float, float, float, float]]]:
    """A photograph (H, W, 3) with the faces (N, 25, 25) in rows, and the box of each, brows to chin."""
    from skimage import data

    step = 3 * height_px
    background = cv2.resize(data.coffee(), (6 * step, 5 * step), interpolation=cv2.INTER_AREA)
    boxes = []
    for number, face in enumerate(faces):
        left, top = step // 2 + number % 5 * step, step // 2 + number // 5 * step
        patch = cv2.resize(face, (height_px, height_px), interpolation=cv2.INTER_CUBIC)
        background[top : top + height_px, left : left + height_px] = patch[..., None]
        boxes.append((left, top, left + height_px - 1, top + height_px - 1))
    return np.ascontiguousarray(background), boxes


def _row(figure: str, value: float | None, aim: float | None, better: str = "higher") -> dict[str, Any]:
    return {
        "stage": "privacy",
        "figure": figure,
        "value": value,
        "unit": "%",
        "aim": aim,
        "better": better,
    }
