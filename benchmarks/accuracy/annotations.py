"""What the import catches of malformed label files, and how exactly average precision is COCO's."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from work import REPOSITORY

from card.annotations.consistency.coco import coco_precision
from card.annotations.consistency.curves import average_precision, match
from card.annotations.import_labels import read_annotations

# Corpus and scenes are those of the tests; what makes them lies with them.
sys.path.append(str(REPOSITORY / "tests" / "unit"))
from label_corpus import FOLDER, corpus, sequence
from label_scenes import random_scene

SCENES = 100
MAP_AIM = 1e-9


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Rows of what does not depend on the drives.

    `malformed_caught` of `malformed_total` : folders of the corpus whose issues have the right file, line and
    code. `map_difference` : the largest difference of any AP between our own matching and pycocotools, over
    random scenes.
    """
    cases = corpus()
    caught = sum(_issues(name) == sorted(wanted) for name, wanted in cases.items())
    return [
        _row("malformed_caught", caught, len(cases), "higher"),
        _row("malformed_total", len(cases), None, "higher"),
        _row("map_difference", max(map(_map_difference, range(SCENES))), MAP_AIM, "lower"),
    ]


def _issues(name: str) -> list[tuple[str, int, str]]:
    _, _, issues = read_annotations(FOLDER / name, sequence(), "auto")
    return [(issue.file, issue.line, issue.code) for issue in issues]


def _map_difference(seed: int) -> float:
    scene = random_scene(seed)
    ours = np.array([average_precision(match(scene, name, "coco"), "coco") for name in (0, 1)])
    theirs = coco_precision(scene, 2)
    if not np.array_equal(np.isnan(ours), np.isnan(theirs)):
        return float("inf")
    return float(np.nan_to_num(np.abs(ours - theirs)).max())


def _row(figure: str, value: float, aim: float | None, better: str) -> dict[str, Any]:
    return {
        "stage": "annotations",
        "figure": figure,
        "value": value,
        "unit": "1",
        "aim": aim,
        "better": better,
    }
