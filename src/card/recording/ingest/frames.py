"""Frames: left images and what belongs to each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.recording.ingest.bursts import BurstTimes
from card.recording.paths import CAMERAS, IMAGE_SUFFIX, LIDARS


def frame_table(
    numbers: Mapping[int, int],
    right_t_ns: npt.NDArray[np.int64],
    bursts: Mapping[str, BurstTimes],
    settings: Mapping[str, Any],
) -> dict[str, list[Any]]:
    """Columns of schema ``frames`` in order of time.

    numbers: {t_ns: frame} of the left images. right_t_ns: (M,) increasing. bursts: by LiDAR.
    """
    left = np.array(sorted(numbers), dtype=np.int64)
    pair = pair_right(left, right_t_ns, settings["stereo_tolerance_ns"])
    right = [int(right_t_ns[index]) if index >= 0 else None for index in pair]
    columns: dict[str, list[Any]] = {
        "frame": [numbers[t_ns] for t_ns in left.tolist()],
        "t_ns": left.tolist(),
        "left_file": [_file(CAMERAS[0], t_ns) for t_ns in left.tolist()],
        "right_file": [_file(CAMERAS[1], t_ns) if t_ns is not None else None for t_ns in right],
        "right_t_ns": right,
    }
    for lidar in LIDARS:
        columns[f"{lidar}_burst"] = key_bursts(left, bursts.get(lidar), settings["burst_after_ns"])
    return columns


def pair_right(
    left: npt.NDArray[np.int64], right: npt.NDArray[np.int64], tolerance_ns: int
) -> npt.NDArray[np.int64]:
    """(N,) index of the right image nearest in time to each left one, -1 beyond the tolerance."""
    if not len(right):
        return np.full(len(left), -1)
    after = np.searchsorted(right, left).clip(0, len(right) - 1)
    before = (after - 1).clip(0)
    nearest = np.where(np.abs(right[before] - left) <= np.abs(right[after] - left), before, after)
    return np.where(np.abs(right[nearest] - left) <= tolerance_ns, nearest, -1)


def key_bursts(left: npt.NDArray[np.int64], bursts: BurstTimes | None, after_ns: int) -> list[int | None]:
    """For each of (N,) times the first burst that ends later, None where none does within `after_ns`."""
    if bursts is None:
        return [None] * len(left)
    first = np.searchsorted(bursts.end_ns, left, side="right")
    return [
        int(index) if index < len(bursts) and bursts.end_ns[index] - t_ns <= after_ns else None
        for index, t_ns in zip(first, left, strict=True)
    ]


def _file(camera: str, t_ns: int) -> str:
    return f"{camera}/{t_ns}{IMAGE_SUFFIX}"
