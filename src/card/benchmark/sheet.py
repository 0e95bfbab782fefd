"""Pictures of a box in the paper's layout (supplement, 'Qualitative Results').

Above: the image, the crop round the box and its true height. Below, a row a method: predicted depth and
height, and the errors of both where there is truth.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import INK, QUIET, bare, figure
from card.benchmark.boxes import box_span
from card.benchmark.pictures import Maps, Span

Array = NDArray[np.float64]

HEADS = ("Predicted depth", "Predicted height", "Depth error", "Height error")
#: How far truth is spread for the eye, pixels; errors and scores know nothing of it.
SPREAD_PX = 2
LEAST_HEIGHT_M = 0.05
NOTHING = "#f1f2f4"


def draw_sheet(
    path: Path,
    title: str,
    image: NDArray[np.uint8],
    box: Sequence[float],
    span: Span,
    truth: Maps,
    predictions: Mapping[str, Maps],
) -> None:
    """Draw one box as PNG.

    image : (H, W, 3) original. box : YOLO, relative. span : the crop. truth, predictions : maps of the crop.
    """
    aspect = truth.depth.shape[0] / truth.depth.shape[1]
    width, row = 7.2, 1.75 * min(1.3, max(0.3, aspect)) + 0.12
    lower = row * len(predictions) + 0.6
    with figure(path, width, 2.6 + lower) as drawing:
        above, below = drawing.subfigures(2, 1, height_ratios=(2.6, lower))
        height = _range(truth.height)
        depth = _percentiles(truth.depth, 2, 98)
        _context(above, title, image, box, span, truth, height)
        panels = below.subplots(len(predictions), 4, squeeze=False)
        errors = {name: _errors(truth, maps) for name, maps in predictions.items()}
        most = [max(_percentiles(error[k], 0, 95)[1] for error in errors.values()) for k in (0, 1)]
        for line, (name, maps) in zip(panels, predictions.items(), strict=True):
            shown = [
                line[0].imshow(maps.depth, cmap=_map("viridis_r"), vmin=depth[0], vmax=depth[1]),
                line[1].imshow(maps.height, cmap=_map("RdYlBu_r"), vmin=-height, vmax=height),
                line[2].imshow(_spread(errors[name][0]), cmap=_map("magma_r"), vmin=0, vmax=most[0]),
                line[3].imshow(_spread(errors[name][1]), cmap=_map("magma_r"), vmin=0, vmax=most[1]),
            ]
            for panel in line:
                bare(panel)
            line[0].set_ylabel(name, fontsize=7.5)
        for panel, head in zip(panels[0], HEADS, strict=True):
            panel.set_title(head, loc="center", fontsize=8)
        for column, picture in enumerate(shown):
            bar = below.colorbar(picture, ax=panels[:, column], location="bottom", fraction=0.06, pad=0.02)
            bar.outline.set_visible(False)
            bar.ax.tick_params(labelsize=6, labelcolor=QUIET, length=0)
            bar.set_label("m", fontsize=6, color=QUIET, labelpad=0)


def draw_heights(
    path: Path,
    title: str,
    image: NDArray[np.uint8],
    truth: Maps,
    predictions: Mapping[str, Maps],
    limit_m: float,
) -> None:
    """Draw a frame's true height and each method's signed height error, whole images side by side, as PNG."""
    count = 2 + len(predictions)
    columns = min(3, count)
    lines = -(-count // columns)
    aspect = image.shape[0] / image.shape[1]
    with figure(path, 2.4 * columns, lines * (2.2 * aspect + 0.3) + 0.3) as drawing:
        panels = drawing.subplots(lines, columns, squeeze=False).ravel()
        drawing.suptitle(title, x=0.01, ha="left", fontsize=9, color=INK)
        panels[0].imshow(image)
        panels[0].set_title("Left image, anonymized")
        heights = {"True height": truth.height}
        heights |= {f"{name}, error": maps.height - truth.height for name, maps in predictions.items()}
        for panel, (name, values) in zip(panels[1:], heights.items(), strict=False):
            shown = panel.imshow(_spread(values), cmap=_map("RdYlBu_r"), vmin=-limit_m, vmax=limit_m)
            panel.set_title(name)
        for panel in panels:
            bare(panel)
        bar = drawing.colorbar(
            shown, ax=list(panels), location="right", fraction=0.03, pad=0.01, extend="both"
        )
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=6, labelcolor=QUIET, length=0)
        bar.set_label("m", fontsize=7, color=QUIET)


def _context(
    figure: Any,
    title: str,
    image: NDArray[np.uint8],
    box: Sequence[float],
    span: Span,
    truth: Maps,
    limit: float,
) -> None:
    figure.suptitle(title, x=0.01, ha="left", fontsize=9, color=INK)
    panels = figure.subplots(1, 3)
    rows, columns = box_span(box, image.shape[1], image.shape[0])
    panels[0].imshow(image)
    panels[1].imshow(image[span])
    panels[2].imshow(_spread(truth.height), cmap=_map("RdYlBu_r"), vmin=-limit, vmax=limit)
    corners = [(columns.start - 0.5, rows.start - 0.5)]
    corners += [(corners[0][0] - span[1].start, corners[0][1] - span[0].start)] * 2
    for panel, corner in zip(panels, corners, strict=True):
        panel.add_patch(_rectangle(corner, columns.stop - columns.start, rows.stop - rows.start))
        bare(panel)
    for panel, name in zip(panels, ("(a) Input RGB", "(b) Box crop", "(c) GT height"), strict=True):
        panel.set_xlabel(name, fontsize=7.5)


def _rectangle(corner: tuple[float, float], width: float, height: float) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle(corner, width, height, fill=False, edgecolor="#d1495b", linewidth=1.0)


def _map(name: str) -> Any:
    from matplotlib import colormaps

    return colormaps[name].with_extremes(bad=NOTHING)


def _errors(truth: Maps, predicted: Maps) -> tuple[Array, Array]:
    return np.abs(predicted.depth - truth.depth), np.abs(predicted.height - truth.height)


def _range(height: Array) -> float:
    return max(LEAST_HEIGHT_M, _percentiles(np.abs(height), 0, 95)[1])


def _percentiles(values: Array, low: float, high: float) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    first, last = (float(edge) for edge in np.percentile(known, (low, high)))
    return first, max(last, first + 1e-6)


def _spread(values: Array) -> Array:
    """Values (h, w) carried into empty pixels next to them, so that sparse truth can be seen."""
    from scipy.ndimage import distance_transform_edt

    empty = ~np.isfinite(values)
    if empty.all():
        return values
    distance, (row, column) = distance_transform_edt(empty, return_indices=True)
    return np.where(distance <= SPREAD_PX, values[row, column], np.nan)
