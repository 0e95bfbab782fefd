"""What of the points in the windows the left camera may see, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled
from card.ground_truth.window_rows import Rows


class View(NamedTuple):
    """The camera at one instant.

    rotation: (3, 3), translation: (3,) of camera_from_world. low, high: (2,) bounds of x/z and y/z.
    nearest: smallest z, metres. fx, fy, cx, cy: of the undistorted image. ego: its mask, (H, W) bool, which
    begins at row `ego_top`.
    """

    rotation: npt.NDArray[np.float64]
    translation: npt.NDArray[np.float64]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    nearest: float
    fx: float
    fy: float
    cx: float
    cy: float
    ego: npt.NDArray[np.bool_]
    ego_top: int


@compiled
def _along(axis: Any, vector: Any) -> float:
    """Component of a vector (3,) along an axis (3,) of float64, summed up in that order."""
    return axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]


@compiled
def look(rows: Rows, view: View, size: float, min_lidars: int, near: Any, box: Any) -> tuple[int, int, int]:
    """List in `near` (V,) the voxels that enough LiDARs hit and that touch the widened field of view.

    box : (2, 3) output, bounds in camera_left of the corners of all voxels that enough LiDARs hit.

    Returns
    -------
    Voxels listed, points in voxels that enough LiDARs hit, points in voxels listed.
    """
    rotation, translation = view.rotation, view.translation
    radius = size * np.sqrt(3) / 2
    slack_low, slack_high = radius * np.sqrt(1 + view.low**2), radius * np.sqrt(1 + view.high**2)
    corner, half = np.empty(3), np.empty(3)
    for k in range(3):
        half[k] = rotation[k, 0] * (size / 2) + rotation[k, 1] * (size / 2) + rotation[k, 2] * (size / 2)
        box[0, k], box[1, k] = np.inf, -np.inf
    listed = redundant = points = 0
    for v in range(rows.corner.shape[0]):
        front, rear = rows.tail[2 * v] - rows.head[2 * v], rows.tail[2 * v + 1] - rows.head[2 * v + 1]
        if front + rear == 0 or int(front > 0) + int(rear > 0) < min_lidars:
            continue
        redundant += front + rear
        for k in range(3):
            corner[k] = _along(rotation[k], rows.corner[v]) + translation[k]
            box[0, k], box[1, k] = min(box[0, k], corner[k]), max(box[1, k], corner[k])
        z = corner[2] + half[2]
        if z < view.nearest - radius:
            continue
        inside = True
        for k in range(2):
            c = corner[k] + half[k]
            inside &= (c - view.low[k] * z >= -slack_low[k]) & (view.high[k] * z - c >= -slack_high[k])
        if inside:
            near[listed] = v
            listed += 1
            points += front + rear
    return listed, redundant, points


@compiled
def _form(a: Any, spread: Any, b: Any) -> float:
    """a' S b of vectors (3,) and a covariance (6,) as in `Rows`."""
    return (
        a[0] * b[0] * spread[0]
        + a[1] * b[1] * spread[3]
        + a[2] * b[2] * spread[5]
        + (a[0] * b[1] + a[1] * b[0]) * spread[1]
        + (a[0] * b[2] + a[2] * b[0]) * spread[2]
        + (a[1] * b[2] + a[2] * b[1]) * spread[4]
    )


@compiled
def _pixels(rows: Rows, v: int, view: View, corner: Any, u: Any, w: Any) -> float:
    """How many pixels the inliers of voxel v cover; see `reference.thinning.pixels_covered`.

    corner : (3,) of the voxel, camera_left, metres. u, w : (3,) memory.
    """
    turn, mean, spread = view.rotation, rows.mean[v], rows.spread[v]
    z = max(corner[2] + _along(turn[2], mean), view.nearest)
    x, y = (corner[0] + _along(turn[0], mean)) / z, (corner[1] + _along(turn[1], mean)) / z
    for k in range(3):
        u[k] = (turn[0, k] - x * turn[2, k]) * (view.fx / z)
        w[k] = (turn[1, k] - y * turn[2, k]) * (view.fy / z)
    across = _form(u, spread, w)
    return 12 * np.sqrt(max(_form(u, spread, u) * _form(w, spread, w) - across * across, 0.0))


@compiled
def emit(
    rows: Rows,
    near: Any,
    view: View,
    pixels_per_point: float,
    keyframe: int,
    points: Any,
    own: Any,
) -> tuple[int, int, int]:
    """Write what cleaning kept of the voxels listed, as far as it is in view and not on the car's own body.

    Of a voxel no more than one point for `pixels_per_point` pixels that it covers; see `reference.thinning`.

    points, own : (P, 3) float64 camera_left, metres, and (P,) bool, from burst `keyframe`; outputs.

    Returns
    -------
    Points within that limit, of these those in view, and of these those not on the body: as many are written.
    """
    rotation, translation = view.rotation, view.translation
    rows_ego, columns_ego = view.ego.shape
    corner, u, w = np.empty(3), np.empty(3), np.empty(3)
    above = view.ego_top - 1 - view.cy
    thinned = in_view = count = 0
    for v in near:
        for k in range(3):
            corner[k] = _along(rotation[k], rows.corner[v]) + translation[k]
        total = rows.left[v]
        share = total
        if pixels_per_point > 0:
            share = min(total, max(1, int(_pixels(rows, v, view, corner, u, w) / pixels_per_point)))
        # Point k of the n that cleaning kept stays where floor(k share / n) steps up: k share mod n < share.
        rest = 0
        for row in range(2 * v, 2 * v + 2):
            for at in range(rows.head[row], rows.tail[row]):
                if not rows.kept[at]:
                    continue
                stays = rest < share
                rest += share
                if rest >= total:
                    rest -= total
                if not stays:
                    continue
                thinned += 1
                x = corner[0] + _along(rotation[0], rows.offset[at])
                y = corner[1] + _along(rotation[1], rows.offset[at])
                z = corner[2] + _along(rotation[2], rows.offset[at])
                if z < view.nearest or x < view.low[0] * z or x > view.high[0] * z:
                    continue
                if y < view.low[1] * z or y > view.high[1] * z:
                    continue
                in_view += 1
                points[count, 0], points[count, 1], points[count, 2] = x, y, z
                own[count] = rows.burst[at] == keyframe
                # Well above the body nothing is divided.
                if y * view.fy >= above * z:
                    line = int(min(max(np.rint(y / z * view.fy + view.cy), 0), rows_ego - 1))
                    if line >= view.ego_top:
                        column = int(min(max(np.rint(x / z * view.fx + view.cx), 0), columns_ego - 1))
                        count -= view.ego[line, column]
                count += 1
    return thinned, in_view, count
