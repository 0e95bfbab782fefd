"""Which points the left camera sees, in two passes (paper, supplement E)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.ground_truth.hpr.cells import reach
from card.ground_truth.hpr.visible import visible_points
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.selection import diagonal

Points = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


def two_pass_visibility(
    static: Points,
    is_keyframe: npt.NDArray[np.bool_],
    keyframe: Points,
    diameter: float,
    settings: Mapping[str, Any],
    workspace: Workspace | None = None,
) -> tuple[Index, Index, Index]:
    """What is seen of the static cloud (N, 3) and of the keyframe (K, 3), camera frame, metres.

    Pass 1 tests the static cloud at R = hpr_first D. Pass 2 tests its survivors together with the whole
    keyframe at R = hpr_second D. `diameter` is D, metres: the diagonal of the frame's whole static cloud,
    not of what is left of it in view. A static point that belongs to the keyframe's burst (`is_keyframe`,
    (N,)) enters pass 2 only as a keyframe point. With `hidden_point_removal` "one_pass" pass 1 tests both
    together and is all there is, with "off" everything counts as seen.

    Returns
    -------
    Indices into `static` after pass 1, into `static` after pass 2, into `keyframe` after pass 2.
    """
    D = diameter
    if max(reach(static), reach(keyframe)) >= settings["hpr_first"] * D:
        # At a sequence's end hardly anything may be static; then the keyframe and the viewer count too.
        D = diagonal(np.concatenate([static, keyframe, np.zeros((1, 3))]))
    passes = settings["hidden_point_removal"]
    if passes == "two_pass":
        first = visible_points(static, settings["hpr_first"] * D, workspace)
    else:
        first = np.arange(len(static))
    again = first[~is_keyframe[first]]
    if passes == "off":
        return first, again, np.arange(len(keyframe))
    both = np.concatenate([np.take(static, again, axis=0), keyframe])
    radius = settings["hpr_second" if passes == "two_pass" else "hpr_first"] * D
    second = visible_points(both, radius, workspace, mostly_visible=passes == "two_pass")
    return first, again[second[second < len(again)]], second[second >= len(again)] - len(again)
