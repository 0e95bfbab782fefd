"""Compiled steps of `StaticWindow`: points by voxel and LiDAR, and the span of them that is in the windows.

The points of voxel v that LiDAR s (0 front, 1 rear) measured lie in row 2 v + s: side by side and in order
of time. Those in the windows are a run of the row, from its head to its tail. A burst that enters moves the
tails of the rows it hits, one that leaves moves their heads; nothing else moves as frames go by.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled


class Rows(NamedTuple):
    """P points in rows of V voxels.

    start: (2 V + 1,) int64. head, tail: (2 V,) int64, ends of the run in the windows.
    offset: (P, 3) float32, metres from the voxel's corner. burst: (P,) int32 ordinals.
    kept: (P,) bool, what cleaning leaves. changed: (V,) bool, cleaning is out of date.
    clean, left: (V,) int64 inliers, and how many of them are kept. corner: (V, 3) float64 world, metres.
    """

    start: npt.NDArray[np.int64]
    head: npt.NDArray[np.int64]
    tail: npt.NDArray[np.int64]
    offset: npt.NDArray[np.float32]
    burst: npt.NDArray[np.int32]
    kept: npt.NDArray[np.bool_]
    changed: npt.NDArray[np.bool_]
    clean: npt.NDArray[np.int64]
    left: npt.NDArray[np.int64]
    corner: npt.NDArray[np.float64]


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
def number(voxel: Any, local: Any, found: Any, count: int) -> int:
    """Give each voxel not met before the next number in `local`, -1 so far, and list it in `found`."""
    for v in voxel:
        if local[v] < 0:
            local[v] = count
            found[count] = v
            count += 1
    return count


@compiled
def measure(voxel: Any, local: Any, sensor: int, size: Any) -> None:
    """Add the points of a burst to the sizes (2 V,) of their rows."""
    for v in voxel:
        size[2 * local[v] + sensor] += 1


@compiled
def fill(voxel: Any, offset: Any, local: Any, sensor: int, ordinal: int, end: Any, rows: Rows) -> None:
    """Append the points of a burst to their rows, which so far end at `end` (2 V,)."""
    for i in range(voxel.size):
        row = 2 * local[voxel[i]] + sensor
        at = end[row]
        end[row] = at + 1
        rows.burst[at] = ordinal
        for k in range(3):
            rows.offset[at, k] = offset[i, k]


@compiled
def move(voxel: Any, local: Any, sensor: int, ends: Any, changed: Any) -> None:
    """Move the heads or the tails (2 V,) past the points of a burst."""
    for v in voxel:
        ends[2 * local[v] + sensor] += 1
        changed[local[v]] = True


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
            corner[k] = (
                rotation[k, 0] * rows.corner[v, 0]
                + rotation[k, 1] * rows.corner[v, 1]
                + rotation[k, 2] * rows.corner[v, 2]
            ) + translation[k]
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
def _median(values: Any, count: int) -> Any:
    """Median of the first values; of an even number the mean of the middle two. They are put in order."""
    if count <= 40:
        for i in range(1, count):
            value, j = values[i], i
            while j > 0 and values[j - 1] > value:
                values[j] = values[j - 1]
                j -= 1
            values[j] = value
    else:
        values[:count].sort()
    return (values[(count - 1) // 2] + values[count // 2]) / np.float32(2)


@compiled
def clean(
    rows: Rows,
    near: Any,
    multiplier: float,
    literal: bool,
    off: bool,
    min_inliers: int,
    limit: int,
    place: Any,
    radius: Any,
    sorted_: Any,
) -> tuple[int, int]:
    """Clean the voxels listed whose points changed; see `reference.mad` and `reference.thinning`.

    place, radius, sorted_ : (M,) int64, float32, float32 memory, for as many points as a voxel holds.

    Returns
    -------
    Inliers in the voxels listed, and how many of them thinning keeps.
    """
    factor = np.float32(multiplier)
    inliers = thinned = 0
    for v in near:
        if rows.changed[v]:
            rows.changed[v] = False
            # The two rows in order of time.
            i, i_end = rows.head[2 * v], rows.tail[2 * v]
            j, j_end = rows.head[2 * v + 1], rows.tail[2 * v + 1]
            count = 0
            x = y = z = 0.0
            while i < i_end or j < j_end:
                if j == j_end or (i < i_end and rows.burst[i] < rows.burst[j]):
                    at = i
                    i += 1
                else:
                    at = j
                    j += 1
                place[count] = at
                count += 1
                x += rows.offset[at, 0]
                y += rows.offset[at, 1]
                z += rows.offset[at, 2]
            x, y, z = x / count, y / count, z / count
            for k in range(count):
                at = place[k]
                dx, dy, dz = rows.offset[at, 0] - x, rows.offset[at, 1] - y, rows.offset[at, 2] - z
                radius[k] = sorted_[k] = np.float32(np.sqrt(dx * dx + dy * dy + dz * dz))
            median = _median(sorted_, count)
            for k in range(count):
                sorted_[k] = abs(radius[k] - median)
                if not literal:
                    radius[k] = sorted_[k]
            largest = np.float32(np.inf) if off else factor * _median(sorted_, count)
            total = 0
            for k in range(count):
                total += radius[k] <= largest
            if total < min_inliers and not off:
                total = 0
            share = min(limit, total) if limit > 0 else total
            rank = 0
            for k in range(count):
                inlier = total > 0 and radius[k] <= largest
                rows.kept[place[k]] = inlier and rank * share // total != (rank - 1) * share // total
                rank += inlier
            rows.clean[v], rows.left[v] = total, share
        inliers += rows.clean[v]
        thinned += rows.left[v]
    return inliers, thinned


@compiled
def emit(
    rows: Rows,
    near: Any,
    view: View,
    size: float,
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
    corner = np.empty(3)
    half = rotation[2, 0] * (size / 2) + rotation[2, 1] * (size / 2) + rotation[2, 2] * (size / 2)
    thinned = in_view = count = 0
    for v in near:
        for k in range(3):
            corner[k] = (
                rotation[k, 0] * rows.corner[v, 0]
                + rotation[k, 1] * rows.corner[v, 1]
                + rotation[k, 2] * rows.corner[v, 2]
            ) + translation[k]
        total = rows.left[v]
        share = total
        if pixels_per_point > 0:
            edge = view.fx * size / max(corner[2] + half, view.nearest)
            share = min(total, max(1, int(edge * edge / pixels_per_point)))
        rank = 0
        for row in range(2 * v, 2 * v + 2):
            for at in range(rows.head[row], rows.tail[row]):
                if not rows.kept[at]:
                    continue
                rank += 1
                if (rank - 1) * share // total == (rank - 2) * share // total:
                    continue
                thinned += 1
                a, b, c = (
                    np.float64(rows.offset[at, 0]),
                    np.float64(rows.offset[at, 1]),
                    np.float64(rows.offset[at, 2]),
                )
                x = corner[0] + (rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c)
                y = corner[1] + (rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c)
                z = corner[2] + (rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c)
                if z < view.nearest or x < view.low[0] * z or x > view.high[0] * z:
                    continue
                if y < view.low[1] * z or y > view.high[1] * z:
                    continue
                in_view += 1
                points[count, 0], points[count, 1], points[count, 2] = x, y, z
                own[count] = rows.burst[at] == keyframe
                line = int(min(max(np.rint(y / z * view.fy + view.cy), 0), rows_ego - 1))
                if line >= view.ego_top:
                    column = int(min(max(np.rint(x / z * view.fx + view.cx), 0), columns_ego - 1))
                    count -= view.ego[line, column]
                count += 1
    return thinned, in_view, count
