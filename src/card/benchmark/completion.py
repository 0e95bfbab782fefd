"""Depth completion: the sweep that a method starts from, and the truth that is that very sweep."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import Trajectory, apply, inverse, rasterize
from card.geometry.corrections import correct_points
from card.packaging.reader import Frame, Release

Array = NDArray[np.float64]


def sparse_depth(frame: Frame) -> Array:
    """Depth (H, W) in metres of the frame's own front sweep in the original left image; NaN where none falls.

    The sweep is the first that ends after the image (the keyframe of the ground truth), with the range and
    channel corrections of the calibration, each point carried to the time of the image by the poses of the
    release. It is what a car has at that moment: unlike in the ground truth, nothing hidden is removed.

    >>> for frame in Release("card-germany").iterate("test"):         # doctest: +SKIP
    ...     completed = method(frame.image(), sparse_depth(frame))

    Raises
    ------
    CardError
        If the release has no front sweep for the frame, or its poses do not cover the sweep.
    """
    release, sequence, number = frame.release, frame.sequence, frame.row["lidar_front_burst"]
    sweep = frame.burst()
    if number is None or sweep is None:
        raise CardError("frame has no front sweep", where=f"{sequence}, frame {frame.number}")
    rig = release.rig(sequence)
    raw = np.column_stack([sweep.x, sweep.y, sweep.z])
    # A beam without return lies at the sensor's origin.
    returned = np.hypot(np.hypot(raw[:, 0], raw[:, 1]), raw[:, 2]) > 0
    offset_ns = np.asarray(sweep["offset_ns"]).astype(np.int64)
    trajectory, ends = _trajectory(release, sequence)
    if number not in ends:
        raise CardError("release has no pose of the sweep", where=f"{sequence}, burst {number}")
    times = ends[number] - offset_ns.max() + offset_ns
    corrections = release.calibration(sequence)["lidar_corrections"]["lidar_front"]
    points = correct_points(raw[returned], np.asarray(sweep["ring"])[returned], corrections)
    stamps, at = np.unique(times[returned], return_inverse=True)
    in_rig = apply(rig.transform("rig_from_lidar_front", {}), points)
    world = apply(trajectory.at(stamps)[at], in_rig)
    camera_from_world = inverse(trajectory.at(frame.row["t_ns"]) @ rig.transform("rig_from_camera_left", {}))
    return rasterize(apply(camera_from_world, world), rig.camera("camera_left"))


def input_pixels(
    pixels: NDArray[np.int64], truth: Array, sparse: Array, tolerance_m: float
) -> NDArray[np.bool_]:
    """Which of the evaluated pixels (M,) have a truth (M,) that is a point of the input (H, W) itself.

    That is: within the tolerance of an input depth in the same or one of the eight neighbouring pixels. The
    released poses are coarser than those the ground truth was made with, which can move a point by a pixel.
    """
    height, width = sparse.shape
    row, column = np.divmod(pixels, width)
    found = np.zeros(truth.shape, dtype=np.bool_)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            v, u = np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)
            found |= np.abs(sparse[v, u] - truth) <= tolerance_m
    return found


@lru_cache(maxsize=1)
def _trajectory(release: Release, sequence: str) -> tuple[Trajectory, dict[int, int]]:
    """``world_from_rig`` of a sequence, and the time at which each front burst ends, by its number."""
    rows = release.poses(sequence)
    by_time = {row["t_ns"]: row for row in rows}
    chosen = [by_time[t_ns] for t_ns in sorted(by_time)]
    trajectory = Trajectory(
        [row["t_ns"] for row in chosen],
        [row["translation_m"] for row in chosen],
        [row["rotation_wxyz"] for row in chosen],
    )
    return trajectory, {row["index"]: row["t_ns"] for row in rows if row["sensor"] == "lidar_front"}
