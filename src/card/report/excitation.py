"""The road as the four wheels felt it: height of each contact along the drive, its slow part taken out."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts.figures import INK, QUIET, figure
from card.report.labels import COLORS as LABEL_COLORS
from card.report.labels import MARKERS

Array = NDArray[np.float64]

STEP_M = 0.05
MEAN_M = 10.0
#: A labelled irregularity within this of the car's middle is one that it drives over or beside, m.
REACH_M = 2.5
SIDES = {"left": ("fl", "rl"), "right": ("fr", "rr")}
COLORS = {"fl": "#1f5f8b", "rl": "#7fb2d6", "fr": "#a8480f", "rr": "#e5a273"}
NAMES = {"fl": "front left", "rl": "rear left", "fr": "front right", "rr": "rear right"}


@dataclass(frozen=True)
class Contact:
    """Contact of one wheel: position (N, 3) in world, m; gap (N,) where it was not measured well.

    ahead_m : how far the wheel is ahead of the rig's origin.
    """

    position: Array
    gap: NDArray[np.bool_]
    ahead_m: float


def draw_excitation(path: Path, contacts: Mapping[str, Contact], places: Mapping[str, Array]) -> None:
    """Draw height over its own running mean against distance: left wheels above, right wheels below.

    Front and rear wheel of a side pass the same spot at the same distance; where they agree, the road is
    what both felt. Stretches that were not measured stay blank. places : labelled irregularities (P, 3) in
    world by class; a mark stands where the car's middle passes one within reach.
    """
    marks = {name: passed(contacts, place) for name, place in places.items()}
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
            for name, distance in marks.items():
                _mark(axes, name, distance)
            axes.set_title(f"{side.capitalize()} wheels")
            axes.set_ylabel("mm")
            axes.legend(loc="upper right", ncols=4, handlelength=1.2, bbox_to_anchor=(1, 1.2))
            axes.margins(x=0)
        panels[1].set_xlabel("distance driven, m", color=INK)


def _mark(axes: Any, name: str, distance: Array) -> None:
    """Labels of one class: a faint line across the panel and a marker at its foot."""
    look = {"color": LABEL_COLORS[name], "transform": axes.get_xaxis_transform()}
    axes.vlines(distance, 0, 1, linewidth=0.8, alpha=0.35, zorder=0, **look)
    label = f"{name} label" if len(distance) else None
    foot = np.full(len(distance), 0.05)
    axes.plot(distance, foot, MARKERS[name], markersize=4, linestyle="none", label=label, **look)


def passed(contacts: Mapping[str, Contact], places: Array) -> Array:
    """Distances (Q,) at which the middle between the front wheels passes those of the places (P, 3) that come
    within `REACH_M` of it, as many times as it does."""
    left, right = contacts["fl"], contacts["fr"]
    middle = (left.position[:, :2] + right.position[:, :2]) / 2
    step = np.linalg.norm(np.diff(middle, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(step)])
    found = []
    for place in places[:, :2]:
        away = np.linalg.norm(middle - place, axis=1)
        near = np.flatnonzero(away <= REACH_M)
        for visit in np.split(near, np.flatnonzero(np.diff(arc[near]) > REACH_M) + 1):
            if len(visit):
                found.append(arc[visit[np.argmin(away[visit])]] + left.ahead_m)
    return np.array(found)


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
