"""Baseline-dependent vote quotas (paper, supplement B)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt


def required_votes(
    baseline: npt.ArrayLike, v_min: int, v_max: int, near: float, far: float
) -> npt.NDArray[np.int64]:
    """req(b; v_min, v_max) for baselines (...) in metres: v_max up to `near`, falling to v_min at `far`.

    Rounded half up; a number within 1e-9 of a half counts as the half it stands for.
    """
    clipped = np.clip(baseline, near, far)
    votes = v_max - (clipped - near) / (far - near) * (v_max - v_min)
    return np.floor(votes + 0.5 + 1e-9).astype(np.int64)


def meets_quotas(
    front_views: npt.NDArray[np.int32],
    rear_views: npt.NDArray[np.int32],
    baseline: npt.NDArray[np.float64],
    settings: Mapping[str, Any],
) -> npt.NDArray[np.bool_]:
    """Whether voxels (V,) have the front and the rear votes that their baseline (V,) asks for."""
    near, far = settings["baseline_near_m"], settings["baseline_far_m"]
    front = required_votes(baseline, settings["front_votes_min"], settings["front_votes_max"], near, far)
    rear = required_votes(baseline, settings["rear_votes_min"], settings["rear_votes_max"], near, far)
    return (front_views >= front) & (rear_views >= rear)
