"""The figure of error against distance: depth and height, a line a method."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts.figures import INK, QUIET, figure

PANELS = (("abs_rel", "AbsRel, 1"), ("height_abs_diff", "Height AbsDiff, m"))
COLORS = ("#1f6f8b", "#d1495b", "#edae49", "#3f7d20", "#6a4c93", "#8a9099")


def draw_distance(path: Path, documents: Sequence[Mapping[str, Any]]) -> None:
    """Draw the errors of full images by range of true depth, of documents `evaluation`, as PNG.

    Depth methods as scaled to the truth's median, completion as predicted; whiskers are the intervals.
    """
    with figure(path, 7.0, 2.9) as drawing:
        axes = drawing.subplots(1, len(PANELS))
        for panel, (metric, name) in zip(axes, PANELS, strict=True):
            for index, document in enumerate(documents):
                scaling = "median" if document["task"] == "depth" else "none"
                rows = [
                    row
                    for row in document["rows"]
                    if (row["region"], row["by"], row["scaling"], row["input_pixels"])
                    == ("full", "distance", scaling, "all")
                    and row["metrics"][metric] is not None
                ]
                _line(panel, rows, metric, document["method"], COLORS[index % len(COLORS)])
            panel.set(title=name, xlabel="true depth, m", xlim=(0, None), ylim=(0, None))
        if len(documents) > 1:
            axes[0].legend(fontsize=7)
        profile = documents[0]["settings"]["profile"] if documents else "-"
        over = documents[0]["counts"]["frames"] if documents else 0
        drawing.suptitle(
            f"Error against distance, full images, profile {profile}, {over} frames", x=0.01, ha="left",
            fontsize=9, color=INK,
        )  # fmt: skip


def _line(panel: Any, rows: Sequence[Mapping[str, Any]], metric: str, name: str, color: str) -> None:
    middles, values = [], []
    for row in rows:
        start, stop = map(float, row["group"].removesuffix(" m").split("-"))
        middles.append((start + stop) / 2)
        values.append(row["metrics"][metric])
        if row["intervals"][metric]:
            panel.plot([middles[-1]] * 2, row["intervals"][metric], color=color, linewidth=0.8, alpha=0.6)
    panel.plot(middles, values, color=color, marker="o", markersize=3, linewidth=1.4, label=name)
    if not values:
        panel.text(0.5, 0.5, "no data", transform=panel.transAxes, ha="center", color=QUIET)
