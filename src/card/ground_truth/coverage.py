"""Which bursts fill a frame's windows, and what that is worth (paper, supplement D)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.sweeps import Drive
from card.ground_truth.window import covered_share, overlapping, window_ns


@dataclass(frozen=True)
class FrameWindow:
    """bursts: (B,) increasing ordinals. columns: the window's part of a row of schema ``coverage``."""

    bursts: npt.NDArray[np.int64]
    columns: dict[str, Any]


def frame_window(drive: Drive, t_ns: int, has_keyframe: bool, settings: Mapping[str, Any]) -> FrameWindow:
    """The bursts of both LiDARs that overlap the windows round an image taken at `t_ns`."""
    bursts = []
    columns: dict[str, Any] = {}
    wanted = covered = 0.0
    for name, front in (("front", True), ("rear", False)):
        low, high = window_ns(t_ns, settings[f"window_{name}_s"])
        of_sensor = drive.of(front)
        start, end = drive.start_ns[of_sensor], drive.end_ns[of_sensor]
        inside = overlapping(start, end, low, high)
        share = covered_share(start, low, high)
        bursts.append(of_sensor[inside])
        wanted, covered = wanted + (high - low), covered + share * (high - low)
        columns |= {
            f"{name}_wanted_start_ns": low,
            f"{name}_wanted_end_ns": high,
            f"{name}_present_start_ns": max(low, int(start[inside].min())) if len(inside) else None,
            f"{name}_present_end_ns": min(high, int(end[inside].max())) if len(inside) else None,
            f"{name}_bursts": len(inside),
            f"{name}_share": share,
        }
    columns["window_share"] = covered / wanted
    columns["flag"] = _flag(columns, has_keyframe, settings["min_window_share"])
    return FrameWindow(np.sort(np.concatenate(bursts)), columns)


def _flag(columns: Mapping[str, Any], has_keyframe: bool, min_share: float) -> str:
    """The worst that is to be said of a frame's windows."""
    if not columns["front_bursts"]:
        return "no_front"
    if not columns["rear_bursts"]:
        return "no_rear"
    if not has_keyframe:
        return "no_keyframe"
    # A LiDAR that is silent for seconds leaves its own window thin, however long the other's is.
    return "cut" if min(columns["front_share"], columns["rear_share"]) < min_share else "complete"
