"""The malformed label folders, and a small sequence that they claim to belong to."""

import csv
from collections import defaultdict
from pathlib import Path

from card.annotations.boxes import Rules
from card.annotations.formats.expected import Expected
from card.artifacts import default_settings

FOLDER = Path(__file__).resolve().parents[1] / "data" / "malformed_labels"


def sequence(size: tuple[int, int] = (100, 80), **changes: object) -> Expected:
    """Four left images 1000 to 4000, frames 10 to 13; the right camera took 1000 and 2500."""
    settings = default_settings("annotations")
    limits = {
        name: settings[name] for name in ("overrun_px", "overrun_share", "duplicate_iou", "subpixel_px")
    }
    return Expected(
        **{
            "frames": {"1000": 10, "2000": 11, "3000": 12, "4000": 13},
            "right": frozenset({"1000", "2500"}),
            "classes": settings["classes"],
            "rules": Rules(size, **limits),
        }
        | changes  # type: ignore[arg-type]
    )


def corpus() -> dict[str, list[tuple[str, int, str]]]:
    """File, line and code that each folder must give."""
    cases = defaultdict(list)
    with (FOLDER / "expected.tsv").open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream, delimiter="\t"):
            cases[row["case"]].append((row["file"], int(row["line"]), row["code"]))
    return dict(cases)
