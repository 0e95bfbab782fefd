"""The report of a sequence's ground truth: what is left after each step, and why points went."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import Figure, write_report
from card.ground_truth.frame import STEPS

_REASONS = {
    "points_static": "outside the static voxels",
    "points_two_lidars": "in voxels that only one LiDAR hit in the frame's windows",
    "points_near_view": "in voxels out of the camera's view",
    "points_clean": "outliers of their voxel (MAD)",
    "points_thinned": "beyond the limits of points a voxel",
    "points_in_view": "out of the camera's view",
    "points_not_ego": "on the car's own body",
    "points_pass_1": "hidden in pass 1",
}


def write_summary(
    path: Path,
    sequence: str,
    why: Mapping[str, int],
    rows: Sequence[Mapping[str, Any]],
    inputs: Mapping[str, Path],
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write the report; `rows` are those of schema ``coverage``, `why` the counts of the static set."""
    totals = {name: sum(row[name] for row in rows) for name in STEPS}
    flags = Counter(row["flag"] for row in rows)
    notes = [
        f"{totals[before] - totals[after]} points {_REASONS[after]}"
        for before, after in pairwise(STEPS)
        if after in _REASONS and totals[before] > totals[after]
    ]
    rejected = sum(row["points_rejected"] for row in rows)
    if rejected:
        notes.append(f"{rejected} points inconsistent with the monocular depth")
    if not why["voxels_not_rigid"]:
        notes.append("the rigidity test rejected no voxel")
    notes += [f"{flags[flag]} frames flagged {flag}" for flag in sorted(flags) if flag != "complete"]
    write_report(
        path,
        stage="ground_truth",
        sequence=sequence,
        settings=settings,
        inputs=inputs,
        counts={**why, "frames": len(rows), **totals, "points_rejected": rejected},
        figures=_figures(rows, flags),
        gates=gates,
        notes=notes,
    )


def _figures(rows: Sequence[Mapping[str, Any]], flags: Mapping[str, int]) -> list[Figure]:
    def median(name: str, factor: float = 1.0) -> float | None:
        return float(np.median([row[name] for row in rows])) * factor if rows else None

    worst = min((row["window_share"] for row in rows), default=None)
    flagged = 100 * (1 - flags["complete"] / len(rows)) if rows else None
    steps = [Figure(f"{name}_median", median(name), "1", f"Median over frames of {name}.") for name in STEPS]
    return [
        Figure("points_per_frame", median("points_saved"), "1", "Median number of points of a frame."),
        Figure("image_coverage_pct", median("image_share", 100), "%", "Median share of pixels with a point."),
        Figure(
            "window_coverage_pct",
            median("window_share", 100),
            "%",
            "Median share of the windows that is filled.",
        ),
        Figure(
            "window_coverage_min_pct",
            None if worst is None else 100 * worst,
            "%",
            "Smallest share of a frame's windows that sweeps fill.",
        ),
        Figure("flagged_frames_pct", flagged, "%", "Share of frames whose windows are cut or lack a sensor."),
        *steps,
    ]
