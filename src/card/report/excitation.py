"""The road as the four wheels felt it: height of each contact along the drive, its slow part taken out."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import INK, QUIET, figure

Array = NDArray[np.float64]

STEP_M = 0.05
MEAN_M = 10.0
SIDES = {"left": ("fl", "rl"), "right": ("fr", "rr")}
COLORS = {"fl": "#1f5f8b", "rl": "#7fb2d6", "fr": "#a8480f", "rr": "#e5a273"}
NAMES = {"fl": "front left", "rl": "rear left", "fr": "front right", "rr": "rear right"}


@dataclass(frozen=True)
class Contact:
    """Contact of one wheel: position (N, 3) in world, m; gap (N,) where it was bridged, not measured.

    ahead_m : how far the wheel is ahead of the rig's origin.
    """

    position: Array
    gap: NDArray[np.bool_]
    ahead_m: float


def draw_excitation(path: Path, contacts: Mapping[str, Contact]) -> None:
    """Draw height over its own running mean against distance: left wheels above, right wheels below.

    Front and rear wheel of a side pass the same spot at the same distance; where they agree, the road is
    what both felt. Bridged stretches stay blank.
    """
    with figure(path, 9.6, 3.6) as drawing:
        panels = drawing.subplots(2, 1, sharex=True, sharey=True)
        for axes, (side, wheels) in zip(panels, SIDES.items(), strict=True):
            for order, wheel in enumerate(wheels):
                distance, height = excitation(contacts[wheel])
                axes.plot(
                    distance,
                    1000 * height,
                    color=COLORS[wheel],
                    linewidth=0.9,
                    label=NAMES[wheel],
                    zorder=3 - order,
                )
            axes.axhline(0, color=QUIET, linewidth=0.5)
            axes.set_title(f"{side.capitalize()} wheels")
            axes.set_ylabel("mm")
            axes.legend(loc="upper right", ncols=2, handlelength=1.2, bbox_to_anchor=(1, 1.2))
            axes.margins(x=0)
        panels[1].set_xlabel("distance driven, m", color=INK)


def excitation(contact: Contact) -> tuple[Array, Array]:
    """Distance (M,) in steps of 5 cm and height (M,) over the running mean of 10 m; NaN in gaps."""
    step = np.linalg.norm(np.diff(contact.position[:, :2], axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(step)])
    moved = np.concatenate([[True], np.diff(arc) > 0])
    arc, z, gap = arc[moved], contact.position[moved, 2], contact.gap[moved]
    even: Array = STEP_M * np.arange(int(arc[-1] / STEP_M) + 1, dtype=np.float64)
    height = np.interp(even, arc, z)
    height = height - _running_mean(height, round(MEAN_M / STEP_M))
    height[np.interp(even, arc, gap.astype(np.float64)) > 0.5] = np.nan
    return even + contact.ahead_m, height


def _running_mean(values: Array, window: int) -> Array:
    """Mean over a window centred at each value; it narrows towards the ends, where a slope must not show."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    i = np.arange(values.size)
    half = np.minimum(window // 2, np.minimum(i, values.size - 1 - i))
    return (total[i + half + 1] - total[i - half]) / (2 * half + 1)
