"""Baseline-dependent vote quotas (paper, supplement B)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt


def required_votes(
    baseline: npt.ArrayLike, v_min: int, v_max: int, near: float, far: float, rounding: str = "half_up"
) -> npt.NDArray[np.int64]:
    """req(b; v_min, v_max) for baselines (...) in metres: v_max up to `near`, falling to v_min at `far`.

    A number within 1e-9 of a half counts as the half it stands for; `rounding` says where halves go.
    """
    clipped = np.clip(baseline, near, far)
    votes = v_max - (clipped - near) / (far - near) * (v_max - v_min)
    up = np.floor(votes + 0.5 + 1e-9).astype(np.int64)
    if rounding == "half_up":
        return up
    half = np.abs(votes + 0.5 - up) <= 1e-9
    even: npt.NDArray[np.int64] = up - (half & (up % 2 == 1))
    return even


def meets_quotas(
    front_views: npt.NDArray[np.int32],
    rear_views: npt.NDArray[np.int32],
    baseline: npt.NDArray[np.float64],
    settings: Mapping[str, Any],
) -> npt.NDArray[np.bool_]:
    """Whether voxels (V,) have the front and the rear votes that their baseline (V,) asks for."""
    near, far = settings["baseline_near_m"], settings["baseline_far_m"]
    rounding = settings["votes_rounding"]
    front, rear = (
        required_votes(
            baseline, settings[f"{name}_votes_min"], settings[f"{name}_votes_max"], near, far, rounding
        )
        for name in ("front", "rear")
    )
    return (front_views >= front) & (rear_views >= rear)
