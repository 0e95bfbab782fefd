"""An evaluation of trajectories as a Markdown table."""

from collections.abc import Mapping
from typing import Any

from card.benchmark.tables import cell, grid

FIGURES = {
    "ate_rmse_m": "ATE [m] ↓",
    "ate_scaled_rmse_m": "ATE, scaled [m] ↓",
    "scale": "scale",
    "rpe_translation_m": "RPE [m] ↓",
    "rpe_rotation_deg": "RPE [deg] ↓",
    "drift_translation_pct": "drift [%] ↓",
    "drift_rotation_deg_per_100m": "drift [deg/100 m] ↓",
}


def markdown(document: Mapping[str, Any]) -> str:
    """A document `odometry` as a Markdown table; ``-`` where nothing was measured."""
    counts, lengths = document["counts"], document["settings"]["segment_lengths_m"]
    lines = [["sequence", "frames", "length [m]", "segments", *FIGURES.values()]]
    for row in document["sequences"]:
        known = [str(row["frames"]), f"{row['length_m']:.1f}", str(row["segments"])]
        lines.append([row["sequence"], *known, *(cell(row[figure], 4) for figure in FIGURES)])
    whole = [str(counts["frames"]), "", str(counts["segments"])]
    lines.append(["mean", *whole, *(cell(document["mean"][figure], 4) for figure in FIGURES)])
    title = f"{document['method']} on {document['repository']} {document['version']}, {document['split']}"
    statement = (
        f"Task odometry. {counts['sequences']} sequences "
        f"({counts['sequences_without_poses']} more have no poses), "
        f"{counts['frames']} frames ({counts['frames_not_predicted']} more are not predicted), "
        f"{counts['segments']} segments of {lengths[0]:g}-{lengths[-1]:g} m. ATE after alignment by a "
        "rigid transform, scaled: by a similarity; RPE from frame to frame; drift as KITTI has it."
    )
    return f"# {title}\n\n{statement}\n\n{grid(lines, left=1)}\n"
