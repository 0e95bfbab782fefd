"""One frame: the left image, the depth of its ground truth and the height of it over the road."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import bare, figure
from card.geometry import CameraModel, rasterize

PANEL_PX = 640
DEPTH_RANGE_M = (3.0, 80.0)
HEIGHT_RANGE_M = 0.25
VEIL = 0.55
# Walls and trees: there, but no topic of a map of the road.
HIGHER = "#b9bec5"


def draw_overlay(
    path: Path,
    frame: int,
    image: NDArray[np.uint8],
    points: NDArray[np.float32],
    camera: CameraModel,
    road_from_camera: NDArray[np.float64] | None,
) -> None:
    """Draw the panels side by side; without a road plane only the first two.

    Parameters
    ----------
    image : (H, W, 3) anonymized left image, as it was taken.
    points : (N, 3) ground truth in camera_left, m.
    camera : model of the image, distortion included.
    road_from_camera : (4, 4), Z is the height over the road.
    """
    small, shown = _shrink(image, camera)
    depth = rasterize(points, shown)
    panels = 2 if road_from_camera is None else 3
    with figure(path, 3.4 * panels, 3.4 * image.shape[0] / image.shape[1] + 0.55) as drawing:
        axes, bars = drawing.subplots(2, panels, height_ratios=(40, 1), squeeze=False)
        bars[0].set_visible(False)
        axes[0].imshow(small)
        axes[0].set_title(f"Left image of frame {frame}, anonymized")
        _depth(axes[1], bars[1], small, depth)
        if road_from_camera is not None:
            _height(axes[2], bars[2], small, depth, shown, road_from_camera)
        for panel in axes:
            bare(panel)


def _shrink(image: NDArray[np.uint8], camera: CameraModel) -> tuple[NDArray[np.uint8], CameraModel]:
    """Image and camera at the size of a panel; pixel centres stay at integers."""
    from PIL import Image

    factor = min(1.0, PANEL_PX / max(camera.width, camera.height))
    size = round(camera.width * factor), round(camera.height * factor)
    sx, sy = size[0] / camera.width, size[1] / camera.height
    shown = CameraModel(
        *size,
        camera.fx * sx,
        camera.fy * sy,
        (camera.cx + 0.5) * sx - 0.5,
        (camera.cy + 0.5) * sy - 0.5,
        camera.distortion,
    )
    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX)), shown


def _veiled(axes: Any, image: NDArray[np.uint8]) -> None:
    grey = image.mean(axis=2, keepdims=True) / 255
    axes.imshow(np.repeat(VEIL + (1 - VEIL) * grey, 3, axis=2), vmin=0, vmax=1)


def _depth(axes: Any, bar_axes: Any, image: NDArray[np.uint8], depth: NDArray[np.float64]) -> None:
    from matplotlib.colors import LogNorm

    _veiled(axes, image)
    norm = LogNorm(*DEPTH_RANGE_M)
    shown = axes.imshow(depth, cmap="viridis_r", norm=norm, interpolation="nearest")
    axes.set_title(f"Depth, {np.isfinite(depth).sum() / depth.size:.0%} of the pixels shown")
    ticks = [5, 10, 20, 40, 80]
    bar = axes.figure.colorbar(shown, cax=bar_axes, orientation="horizontal")
    bar.set_ticks(ticks, labels=[*map(str, ticks[:-1]), "80 m"])
    _quiet(bar)


def _height(
    axes: Any,
    bar_axes: Any,
    image: NDArray[np.uint8],
    depth: NDArray[np.float64],
    camera: CameraModel,
    road_from_camera: NDArray[np.float64],
) -> None:
    from matplotlib import colormaps

    v, u = np.nonzero(np.isfinite(depth))
    rays = camera.rays(np.stack([u, v], axis=1))
    height = np.full(depth.shape, np.nan)
    height[v, u] = depth[v, u] * (rays @ road_from_camera[2, :3]) + road_from_camera[2, 3]
    _veiled(axes, image)
    limit = HEIGHT_RANGE_M
    colors = colormaps["RdYlBu_r"].with_extremes(over=HIGHER)
    shown = axes.imshow(height, cmap=colors, vmin=-limit, vmax=limit, interpolation="nearest")
    axes.set_title("Height over the road plane, what is higher in grey")
    bar = axes.figure.colorbar(shown, cax=bar_axes, orientation="horizontal", extend="both", extendfrac=0.02)
    bar.set_ticks([-limit, 0, limit], labels=[f"{-100 * limit:.0f}", "0", f"{100 * limit:.0f} cm"])
    _quiet(bar)


def _quiet(bar: Any) -> None:
    bar.outline.set_visible(False)
    bar.minorticks_off()
