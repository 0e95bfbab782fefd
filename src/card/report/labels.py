"""The labels of a sequence: where they are in the image, how large at which distance, how high."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import INK, QUIET, bare, figure

Array = NDArray[np.float64]

COLORS = {"positive": "#c8641b", "negative": "#2a6aa8"}
MARKERS = {"positive": "^", "negative": "v"}
CELLS = 96
"""Of the heat map, across the image."""
STEP_CM = 1.0


@dataclass(frozen=True)
class Labels:
    """B boxes: names; edges (B, 4) x_min, y_min, x_max, y_max as shares of an image of ``size`` px.

    distance_m : (B,) from the car. deviation_m : (B,) how far the ground truth rises in a positive box or,
    then negative, falls in a negative one. Both NaN where unknown.
    """

    names: NDArray[np.str_]
    edges: Array
    size: tuple[int, int]
    distance_m: Array
    deviation_m: Array


def draw_labels(path: Path, labels: Labels) -> None:
    """Draw the heat map of positions, size against distance, and the distribution of heights."""
    with figure(path, 9.6, 3.3) as drawing:
        left, middle, right = drawing.subplots(1, 3, width_ratios=(1.05, 1, 1))
        _heat(drawing, left, labels)
        _sizes(middle, labels)
        _heights(right, labels)
        drawing.legend(*middle.get_legend_handles_labels(), loc="outside upper right", ncols=2)


def coverage(edges: Array, shape: tuple[int, int]) -> NDArray[np.int64]:
    """How many boxes (B, 4), in shares of the image, cover the centre of each cell (rows, columns)."""
    rows, columns = ((np.arange(n) + 0.5) / n for n in shape)
    across = (columns >= edges[:, 0:1]) & (columns < edges[:, 2:3])
    down = (rows >= edges[:, 1:2]) & (rows < edges[:, 3:4])
    return np.einsum("br,bc->rc", down.astype(np.int64), across.astype(np.int64))


def _heat(drawing: Any, axes: Any, labels: Labels) -> None:
    width, height = labels.size
    count = coverage(labels.edges, (round(CELLS * height / width), CELLS))
    shown = axes.imshow(
        np.where(count > 0, count, np.nan),
        cmap="YlOrRd",
        vmin=0,
        extent=(0, width, height, 0),
        interpolation="nearest",
    )
    bare(axes)
    axes.spines[:].set_visible(True)
    axes.set_title(f"Where {len(labels.edges)} boxes are in the image")
    bar = drawing.colorbar(shown, ax=axes, aspect=30, shrink=0.85, pad=0.02)
    bar.set_label("boxes")
    bar.locator = _whole()
    bar.outline.set_visible(False)


def _sizes(axes: Any, labels: Labels) -> None:
    sides = (labels.edges[:, 2:] - labels.edges[:, :2]) * labels.size
    for name, color in COLORS.items():
        chosen = (labels.names == name) & np.isfinite(labels.distance_m)
        axes.plot(
            labels.distance_m[chosen],
            np.sqrt(sides[chosen].prod(axis=1)),
            MARKERS[name],
            color=color,
            markersize=4,
            markeredgewidth=0,
            alpha=0.6,
            label=f"{name} ({int((labels.names == name).sum())})",
        )
    axes.set(xscale="log", yscale="log", xlabel="distance, m")
    axes.set_title("Size of a box, px (root of its area)")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(_plain)
        axis.set_minor_formatter(_plain)


def _heights(axes: Any, labels: Labels) -> None:
    deviation = 100 * labels.deviation_m
    known = deviation[np.isfinite(deviation)]
    axes.set_title("Ground truth over the ground around")
    axes.set_xlabel("cm")
    axes.axvline(0, color=INK, linewidth=0.6)
    if not known.size:
        axes.annotate("no ground truth", (0.5, 0.5), xycoords="axes fraction", ha="center", color=QUIET)
        return
    edges = np.arange(np.floor(known.min()), np.ceil(known.max()) + 2 * STEP_CM, STEP_CM)
    for name, color in COLORS.items():
        chosen = (labels.names == name) & np.isfinite(deviation)
        axes.hist(deviation[chosen], bins=edges, color=color, alpha=0.8)
    axes.yaxis.set_major_locator(_whole())


def _whole() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(5, integer=True)


def _plain(value: float, _: int) -> str:
    """A tick at 1, 2 or 5 times a power of ten; others stay blank."""
    return f"{value:g}" if f"{value:e}"[0] in "125" else ""
