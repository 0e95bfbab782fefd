"""The cleaned cloud of a frame and what the camera sees of it, as one would first write it: numpy and Open3D.

`tuned` is the same with the cleaning compiled and the cloud cropped to the camera before visibility.
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from card.geometry import apply
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.reference.hidden_points import visible_by_hull
from card.ground_truth.selection import diagonal
from card.ground_truth.static_set import StaticSet
from card.ground_truth.voxels import find

#: Voxels that the loop in Python cleans; its time is scaled to all of them.
LOOP_VOXELS = 4000
Points = NDArray[np.float64]


def naive_frame(
    sweeps: Sequence[Points],
    front: Sequence[bool],
    keyframe: Points,
    static: StaticSet,
    camera_from_world: Points,
    camera: LeftCamera,
    settings: Mapping[str, Any],
) -> tuple[dict[str, float], dict[str, float], tuple[Points, Points, float]]:
    """CPU-seconds by stage of the naive way and of the tuned one; and the cloud, keyframe and D to see.

    Parameters
    ----------
    sweeps : world points of the bursts in the windows; front : whose they are. keyframe : (K, 3) world.
    """
    clock = _Clock()
    points = np.concatenate(sweeps)
    is_front = np.repeat(front, [len(sweep) for sweep in sweeps])
    voxel = find(static.keys, static.grid.keys(points))
    inside = voxel >= 0
    points, voxel, is_front = points[inside], voxel[inside], is_front[inside]
    seen = np.zeros((2, len(static.keys)), dtype=bool)
    seen[0, voxel[is_front]] = seen[1, voxel[~is_front]] = True
    redundant = seen.all(axis=0)[voxel]
    points, voxel = points[redundant], voxel[redundant]
    order = np.argsort(voxel, kind="stable")
    points, voxel = points[order], voxel[order]
    starts = np.flatnonzero(np.r_[True, voxel[1:] != voxel[:-1]])
    ends = np.r_[starts[1:], len(voxel)]
    select = clock.lap()

    multiplier = settings["mad_multiplier"]
    sample = np.linspace(0, len(starts) - 1, LOOP_VOXELS).astype(int)
    for a, b in zip(starts[sample], ends[sample], strict=True):
        radius = np.linalg.norm(points[a:b] - points[a:b].mean(axis=0), axis=1)
        deviation = np.abs(radius - np.median(radius))
        np.flatnonzero(deviation <= multiplier * np.median(deviation))
    loop = clock.lap() * len(starts) / len(sample)
    _inliers(points[:9], starts[:1], np.array([9]), multiplier)
    clock.lap()
    points = points[_inliers(points, starts, ends, multiplier)]
    compiled = clock.lap()

    cloud, key = apply(camera_from_world, points), apply(camera_from_world, keyframe)
    D = diagonal(cloud)
    key = _visible_part(key, camera, settings)
    clock.lap()
    whole = _two_passes(cloud, key, D, settings, clock)
    cloud = _visible_part(cloud, camera, settings)
    crop = clock.lap()
    cropped = _two_passes(cloud, key, D, settings, clock)
    naive = {"select": select, f"MAD, {LOOP_VOXELS} voxels scaled to {len(starts)}": loop, "Open3D": whole}
    tuned = {"select": select, "MAD, compiled": compiled, "crop": crop, "Open3D": cropped}
    return naive, tuned, (cloud, key, D)


class _Clock:
    def __init__(self) -> None:
        self._last = time.process_time()

    def lap(self) -> float:
        """CPU-seconds since the last lap."""
        before, self._last = self._last, time.process_time()
        return self._last - before


def _visible_part(points: Points, camera: LeftCamera, settings: Mapping[str, Any]) -> Points:
    points = points[camera.in_view(points, settings["view_margin_rad"], settings["nearest_depth_m"])]
    return points[~camera.on_ego(points)]


def _two_passes(cloud: Points, key: Points, D: float, settings: Mapping[str, Any], clock: _Clock) -> float:
    first = visible_by_hull(cloud, settings["hpr_first"] * D)
    visible_by_hull(np.concatenate([cloud[first], key]), settings["hpr_second"] * D)
    return clock.lap()


@njit(cache=True)
def _inliers(points: Any, starts: Any, ends: Any, multiplier: float) -> Any:
    keep = np.zeros(len(points), np.bool_)
    for g in range(len(starts)):
        own = points[starts[g] : ends[g]]
        mean = np.array([own[:, 0].mean(), own[:, 1].mean(), own[:, 2].mean()])
        radius = np.sqrt(((own - mean) ** 2).sum(axis=1))
        deviation = np.abs(radius - np.median(radius))
        keep[starts[g] : ends[g]] = deviation <= multiplier * np.median(deviation)
    return keep
