"""How dense the ground truth of each frame is, how full its windows were and where points went."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import QUIET, figure

BAR = "#3f6f8f"
LIDARS = {"front": "#3f6f8f", "rear": "#c98a3a"}
STEPS = {
    "points_window": "in the windows",
    "points_static": "static",
    "points_two_lidars": "seen by both LiDARs",
    "points_near_view": "near the view",
    "points_clean": "clean (MAD)",
    "points_in_view": "in view",
    "points_not_ego": "not the car itself",
    "points_pass_1": "visible, first pass",
    "points_pass_2": "visible, second pass",
    "points_saved": "on the image",
}


def draw_density(path: Path, coverage: Mapping[str, NDArray[Any]]) -> None:
    """Draw the columns (F,) of table `coverage`: points a frame, share of windows filled, points by step."""
    with figure(path, 9.6, 3.4) as drawing:
        grid = drawing.add_gridspec(2, 2, height_ratios=(3, 2), width_ratios=(3, 2))
        upper = drawing.add_subplot(grid[0, 0])
        _points(upper, coverage)
        _windows(drawing.add_subplot(grid[1, 0], sharex=upper), coverage)
        _steps(drawing.add_subplot(grid[:, 1]), coverage)


def _points(axes: Any, coverage: Mapping[str, NDArray[Any]]) -> None:
    saved = coverage["points_saved"] / 1000
    axes.bar(coverage["frame"], saved, width=0.8, color=BAR)
    axes.axhline(float(np.median(saved)), color=QUIET, linewidth=0.8)
    axes.set_title(
        f"Points a frame, median {1000 * np.median(saved):,.0f} "
        f"on {np.median(coverage['image_share']):.1%} of the pixels"
    )
    axes.set_ylabel("thousands")
    axes.margins(x=0.01)
    axes.tick_params(labelbottom=False)


def _windows(axes: Any, coverage: Mapping[str, NDArray[Any]]) -> None:
    for lidar, color in LIDARS.items():
        axes.plot(
            coverage["frame"],
            100 * coverage[f"{lidar}_share"],
            ".-",
            color=color,
            linewidth=1,
            markersize=3,
            label=f"{lidar} LiDAR",
        )
    axes.set_title("Share of each window that sweeps fill")
    axes.set(ylabel="%", xlabel="frame", ylim=(0, 105))
    axes.legend(loc="lower right", ncols=2, handlelength=1.2, bbox_to_anchor=(1, 1.02))
    axes.xaxis.get_major_locator().set_params(integer=True)


def _steps(axes: Any, coverage: Mapping[str, NDArray[Any]]) -> None:
    medians = [float(np.median(coverage[step])) for step in STEPS]
    rows = np.arange(len(STEPS))
    axes.barh(rows, medians, height=0.62, color=BAR)
    for row, median in zip(rows, medians, strict=True):
        axes.annotate(
            f"{median:,.0f}", (median, row), (3, 0), textcoords="offset points", va="center", fontsize=7
        )
    axes.set_yticks(rows, list(STEPS.values()))
    axes.invert_yaxis()
    axes.grid(False)
    axes.spines[["bottom", "left"]].set_visible(False)
    axes.set(xticks=[], xlim=(0, 1.2 * max(*medians, 1.0)))
    axes.set_title("Points left after each step, median frame")
