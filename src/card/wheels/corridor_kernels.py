"""The points of a burst near a contact path, compiled: before they are in the world and after."""

from typing import Any

import numba
import numpy as np

_compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
#: Poses of a path that share a box: a point far from the box is far from all of them.
BOX = 32


@_compiled
def near_cells(points: Any, seen: Any, cell_m: float) -> Any:
    """Whether the x, y of points (N, 3) lie in the cell of one of the places (S, 2), S >= 1, or beside it."""
    inverse = 1.0 / cell_m
    low_x, low_y = np.floor(seen[:, 0].min() * inverse) - 1, np.floor(seen[:, 1].min() * inverse) - 1
    rows = int(np.floor(seen[:, 0].max() * inverse) - low_x) + 2
    columns = int(np.floor(seen[:, 1].max() * inverse) - low_y) + 2
    marked = np.zeros((rows, columns), dtype=np.bool_)
    for s in range(len(seen)):
        row = int(np.floor(seen[s, 0] * inverse) - low_x)
        column = int(np.floor(seen[s, 1] * inverse) - low_y)
        marked[row - 1 : row + 2, column - 1 : column + 2] = True
    near = np.zeros(len(points), dtype=np.bool_)
    for n in range(len(points)):
        row = int(np.floor(points[n, 0] * inverse) - low_x)
        column = int(np.floor(points[n, 1] * inverse) - low_y)
        if 0 <= row < rows and 0 <= column < columns:
            near[n] = marked[row, column]
    return near


@_compiled
def nearest_poses(points: Any, position: Any, reach_m: float) -> Any:
    """Index (P,) of the pose nearest to each point (P, 3) among poses at (M, 3); -1 if none is in reach."""
    boxes = (len(position) + BOX - 1) // BOX
    low, high = np.empty((boxes, 3)), np.empty((boxes, 3))
    for b in range(boxes):
        for axis in range(3):
            low[b, axis] = position[b * BOX : (b + 1) * BOX, axis].min()
            high[b, axis] = position[b * BOX : (b + 1) * BOX, axis].max()
    found = np.full(len(points), -1)
    for n in range(len(points)):
        best = reach_m * reach_m
        for b in range(boxes):
            to_box = 0.0
            for axis in range(3):
                beside = max(low[b, axis] - points[n, axis], points[n, axis] - high[b, axis], 0.0)
                to_box += beside * beside
            if to_box > best:
                continue
            for i in range(b * BOX, min((b + 1) * BOX, len(position))):
                squared = 0.0
                for axis in range(3):
                    squared += (points[n, axis] - position[i, axis]) ** 2
                if squared < best:
                    best = squared
                    found[n] = i
    return found


@_compiled
def any_among(voxel: Any, steps: Any, extent: Any, keys: Any) -> Any:
    """Whether a voxel (N, 3) moved by any of the steps (S, 3) lies in the extent and is among the keys."""
    found = np.zeros(len(voxel), dtype=np.bool_)
    for n in range(len(voxel)):
        for s in range(len(steps)):
            i, j, k = voxel[n, 0] + steps[s, 0], voxel[n, 1] + steps[s, 1], voxel[n, 2] + steps[s, 2]
            if not (0 <= i < extent[0] and 0 <= j < extent[1] and 0 <= k < extent[2]):
                continue
            key = (i * extent[1] + j) * extent[2] + k
            low, high = 0, len(keys)
            while low < high:
                middle = (low + high) // 2
                if keys[middle] < key:
                    low = middle + 1
                else:
                    high = middle
            if low < len(keys) and keys[low] == key:
                found[n] = True
                break
    return found
