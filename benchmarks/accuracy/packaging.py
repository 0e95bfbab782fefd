"""Seeded faults that validation finds; splits of a fleet of the paper's size: leakage and balance."""

import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fleet import fleet

from card.artifacts import default_settings
from card.splits.balance import balance_columns, stratum_deviation
from card.splits.drives import Drive
from card.splits.extend import choose
from card.splits.leakage import leakage_columns, percentile_m
from card.splits.ledger import UNASSIGNED, Row

SEED = 1


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Rows of the faults found, and `leak_m_p5` and `stratum_deviation` of a fleet.

    The release's own few drives are too few to say anything about splits.
    """
    settings = default_settings("splits")
    drives = fleet(SEED)
    frames = assigned(drives, choose([], drives, settings))
    leaks = leakage_columns(
        frames,
        {drive.id: drive.track for drive in drives if drive.track},
        {drive.id: drive.place for drive in drives},
    )
    caught, total = corruptions()
    figures = (
        ("corruptions_caught", caught, "1", total, "higher"),
        ("corruptions_total", total, "1", 60, "higher"),
        ("leak_m_p5", percentile_m(leaks, 5), "m", settings["merge_distance_m"], "higher"),
        ("stratum_deviation", stratum_deviation(balance_columns(frames, settings)), "1", 0.05, "lower"),
    )
    return [
        {"stage": "packaging", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": better}
        for figure, value, unit, aim, better in figures
    ]


def corruptions() -> tuple[int, int]:
    """How many of the faults that the tests seed are found and named, and how many there are."""
    sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "unit"))
    from packaging_corruptions import LEDGER, SEALED, UNSEALED
    from packaging_drive import build_tree
    from packaging_faults import seal

    from card.packaging.validate import find_problems

    caught = 0
    with tempfile.TemporaryDirectory() as scratch:
        valid = build_tree(Path(scratch) / "valid")
        for name, (corrupt, wanted) in (UNSEALED | SEALED).items():
            tree = Path(shutil.copytree(valid, Path(scratch) / "card-germany"))
            corrupt(tree)
            if name in SEALED:
                seal(tree)
            caught += any(re.search(wanted, line) for line in find_problems(tree, ledger=LEDGER))
            shutil.rmtree(tree)
    return caught, len(UNSEALED | SEALED)


def assigned(drives: Sequence[Drive], ledger: Sequence[Row]) -> list[dict[str, Any]]:
    """{sequence, frame, split, stratum} of the sampled frames."""
    of_drive: dict[str, list[Row]] = {}
    for row in ledger:
        of_drive.setdefault(row.sequence, []).append(row)
    found = []
    for drive in drives:
        for frame, stratum, sampled in zip(drive.frames.tolist(), drive.strata, drive.sampled, strict=True):
            if sampled:
                row = next((row for row in of_drive.get(drive.id, ()) if row.covers(frame)), None)
                split = row.split if row else UNASSIGNED
                found.append({"sequence": drive.id, "frame": frame, "split": split, "stratum": stratum})
    return found
