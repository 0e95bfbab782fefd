"""Monocular depth as a rejector of residual movers, for sequences that ask for it (paper, supplement E).

It never adds a point. Its depth belongs to the undistorted left image, made from the anonymized one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.geometry import CameraModel
from card.geometry.rasterize import rasterize

Points = npt.NDArray[np.float64]
Depth = npt.NDArray[np.float32]
#: Depth (H, W) of a frame, up to scale; 0 or not finite where there is none. Takes frame number and time, ns.
DepthSource = Callable[[int, int], Depth]

#: Fewest pixels from which a scale is taken.
MIN_PIXELS = 50


class Consensus:
    """Compares points with the monocular depth of their frame.

    camera : of the undistorted left image. settings: ``consensus`` of the stage.
    """

    def __init__(self, source: DepthSource, camera: CameraModel, settings: Mapping[str, Any]) -> None:
        self._source, self._camera, self._settings = source, camera, settings

    def consistent(self, frame: int, t_ns: int, points: Points, keyframe: Points) -> npt.NDArray[np.bool_]:
        """Which points (N, 3), camera_left, stay; the keyframe (K, 3) gives the scale.

        A point stays if the depth z' at its pixel, to scale, has |z' - z| <= tau_rel z and at most
        max(tau_abs, tau_rel z). Points beyond `max_range_m`, off the image or where nothing is predicted
        stay, and all do if too few pixels have both depths.
        """
        depth = self._source(frame, t_ns)
        scale = fit_scale(rasterize(keyframe, self._camera), depth, self._settings["fit_percentiles"])
        keep = np.ones(len(points), dtype=np.bool_)
        if scale is None:
            return keep
        pixels = self._camera.project(points)
        near = (points[:, 2] <= self._settings["max_range_m"]) & self._camera.contains(pixels)
        at = np.flatnonzero(near)
        column, row = np.floor(pixels[at] + 0.5).astype(np.int64).T
        predicted, z = scale * depth[row, column].astype(np.float64), points[at, 2]
        error = np.abs(predicted - z)
        relative, absolute = self._settings["tau_rel"], self._settings["tau_abs_m"]
        fits = (error / z <= relative) & (error <= np.maximum(absolute, relative * z))
        keep[at] = fits | ~_valid(predicted)
        return keep


def fit_scale(lidar: Points, depth: Depth, percentiles: tuple[float, float]) -> float | None:
    """s > 0 that minimizes sum (lidar - s depth)^2, None from too few pixels.

    Parameters
    ----------
    lidar, depth : (H, W) metres, NaN where there is none, and up to scale.
    percentiles : LiDAR depths outside these of all common pixels are dropped first.
    """
    both = np.isfinite(lidar) & _valid(depth)
    z, d = lidar[both], depth[both].astype(np.float64)
    if len(z) < MIN_PIXELS:
        return None
    low, high = np.percentile(z, percentiles)
    inside = (z >= low) & (z <= high)
    z, d = z[inside], d[inside]
    return float((z * d).sum() / (d * d).sum())


def depth_maps(folder: Path, camera: CameraModel) -> DepthSource:
    """Maps <frame:06d>.npy of a folder, float32 (H, W) of the undistorted image.

    Raises
    ------
    CardError
        From the source, for a map that is missing, unreadable or of another shape.
    """

    def read(frame: int, t_ns: int) -> Depth:
        path = folder / f"{frame:06d}.npy"
        wanted = f"float32, {camera.height} x {camera.width}"
        try:
            depth = np.load(path, allow_pickle=False)
        except FileNotFoundError:
            raise CardError("depth map is missing", where=path, wanted=wanted) from None
        except (ValueError, OSError, EOFError) as error:
            raise CardError("unreadable depth map", where=path, wanted=wanted) from error
        if depth.dtype != np.float32 or depth.shape != (camera.height, camera.width):
            raise CardError(
                "depth map does not fit the undistorted image",
                where=path,
                found=f"{depth.dtype}, {' x '.join(map(str, depth.shape))}",
                wanted=wanted,
            )
        return np.asarray(depth, dtype=np.float32)

    return read


def _valid(depth: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    return np.isfinite(depth) & (depth > 0)
