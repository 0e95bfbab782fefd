"""The drive from above: its track over the static voxels, coloured by their height over the road."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import INK, bare, figure
from card.geometry import Trajectory
from card.report.labels import COLORS, MARKERS

Array = NDArray[np.float64]

LONGER_SIDE_PX = 1100
MARGIN_M = 25.0
HEIGHT_RANGE_M = (-0.2, 6.0)
PALEST = 0.15  # what is lowest must still stand out from the paper
TRACK = "#c2313f"
SCALE_BARS_M = (5, 10, 20, 50, 100, 200, 500, 1000, 2000)


def draw_map(
    path: Path,
    trajectory: Trajectory,
    rig_height_m: float,
    voxels: Array | None,
    camera_t_ns: NDArray[np.int64],
    irregularities: Mapping[str, Array],
) -> None:
    """Draw track, start and the stretch the cameras saw; a drive that is long in Y lies on its side.

    Parameters
    ----------
    rig_height_m : height of the rig's origin over the road.
    voxels : (V, 3) centres of the static voxels in world, m; None where there is no map.
    camera_t_ns : (F,) times of the left images; may be empty.
    irregularities : (I, 3) places in world of each class, m.
    """
    turn = _lying(trajectory.translation_m)
    track = trajectory.translation_m @ turn.T
    low, high = track[:, :2].min(axis=0) - MARGIN_M, track[:, :2].max(axis=0) + MARGIN_M
    extent = high - low
    with figure(path, 9.6, 8.2 * extent[1] / extent[0] + 0.4) as drawing:
        axes = drawing.subplots()
        if voxels is not None:
            _voxels(drawing, axes, voxels @ turn.T, track, rig_height_m, low, extent)
        axes.plot(track[:, 0], track[:, 1], color=TRACK, linewidth=0.9, label="driven")
        known = camera_t_ns[(camera_t_ns >= trajectory.start_ns) & (camera_t_ns <= trajectory.end_ns)]
        seen = trajectory.at(known)[:, :3, 3] @ turn.T
        axes.plot(*seen[:, :2].T, color=TRACK, linewidth=3.2, solid_capstyle="round", label="with images")
        axes.plot(*track[0, :2], "o", color=TRACK, markersize=5, markeredgecolor="white", label="start")
        for name, places in irregularities.items():
            x, y = (places @ turn.T)[:, :2].T
            look = {"color": COLORS[name], "markersize": 6, "markeredgecolor": "white", "linestyle": "none"}
            axes.plot(x, y, MARKERS[name], label=f"{name} ({len(places)})", **look)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        bare(axes)
        _scale_bar(axes, low, extent)
        drawing.legend(loc="outside upper left", ncols=5, handlelength=1.4)


def highest_in_cells(voxels: Array, low: Array, cell_m: float, shape: tuple[int, int]) -> Array:
    """Greatest z (rows, columns) of voxels (V, 3) over each cell counted from ``low``; NaN where none are."""
    column, row = np.floor((voxels[:, :2] - low) / cell_m).astype(np.int64).T
    inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
    top = np.full(shape[0] * shape[1], -np.inf)
    np.maximum.at(top, row[inside] * shape[1] + column[inside], voxels[inside, 2])
    top[np.isinf(top)] = np.nan
    return top.reshape(shape)


def _voxels(
    drawing: Any, axes: Any, voxels: Array, track: Array, rig_height_m: float, low: Array, extent: Array
) -> None:
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, PowerNorm
    from scipy.spatial import cKDTree

    cell = max(0.2, float(extent.max()) / LONGER_SIDE_PX)
    shape = int(np.ceil(extent[1] / cell)), int(np.ceil(extent[0] / cell))
    top = highest_in_cells(voxels, low, cell, shape)
    row, column = np.nonzero(np.isfinite(top))
    # Height over the road where the car came nearest: a slope of the drive would drown all else.
    _, nearest = cKDTree(track[:, :2]).query(low + (np.stack([column, row], axis=1) + 0.5) * cell)
    top[row, column] -= track[nearest, 2] - rig_height_m
    shown = axes.imshow(
        top,
        origin="lower",
        extent=(low[0], low[0] + shape[1] * cell, low[1], low[1] + shape[0] * cell),
        cmap=ListedColormap(colormaps["YlGnBu"](np.linspace(PALEST, 1, 256))),
        norm=PowerNorm(0.5, *HEIGHT_RANGE_M),  # kerbs matter as much as gables
        interpolation="nearest",
    )
    bar = drawing.colorbar(shown, ax=axes, extend="both", extendfrac=0.02, aspect=40, shrink=0.6, pad=0.01)
    bar.set_ticks([0, 0.5, 2, 4, 6], labels=["0", "0.5", "2", "4", "6 m"])
    bar.set_label("highest static voxel over the road")
    bar.outline.set_visible(False)


def _lying(track: Array) -> Array:
    """Rotation (3, 3) about z that lays a track (N, 3) which is longer in Y than in X on its side."""
    extent = np.ptp(track, axis=0)
    if extent[0] >= extent[1]:
        return np.eye(3)
    return np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def _scale_bar(axes: Any, low: Array, extent: Array) -> None:
    length = max((bar for bar in SCALE_BARS_M if bar <= extent[0] / 4), default=SCALE_BARS_M[0])
    x, y = low + 0.03 * extent.min()
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2, solid_capstyle="butt")
    axes.annotate(f"{length} m", (x + length / 2, y), (0, 3), textcoords="offset points", ha="center")
