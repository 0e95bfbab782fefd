"""How many malformed label files the import catches, with the right code and line."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from work import REPOSITORY

from card.annotations.import_labels import read_annotations

# The corpus is a test's; its reader lies with it.
sys.path.append(str(REPOSITORY / "tests" / "unit"))
from label_corpus import FOLDER, corpus, sequence


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Rows `malformed_caught` and `malformed_total`: folders of the corpus, whatever the drives."""
    cases = corpus()
    caught = sum(_issues(name) == sorted(wanted) for name, wanted in cases.items())
    return [
        _row("malformed_caught", caught, len(cases), "higher"),
        _row("malformed_total", len(cases), None, "higher"),
    ]


def _issues(name: str) -> list[tuple[str, int, str]]:
    _, _, issues = read_annotations(FOLDER / name, sequence(), "auto")
    return [(issue.file, issue.line, issue.code) for issue in issues]


def _row(figure: str, value: float, aim: float | None, better: str) -> dict[str, Any]:
    return {
        "stage": "annotations",
        "figure": figure,
        "value": value,
        "unit": "1",
        "aim": aim,
        "better": better,
    }
