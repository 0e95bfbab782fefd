"""The height profile of the ground truth inside a box."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.irregularities.ground import fit_ground

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SIGNS = {"positive": 1.0, "negative": -1.0}
AGREES, DOUBTFUL, UNKNOWN = "agrees", "doubtful", "unknown"


@dataclass(frozen=True)
class View:
    """The ground truth of one frame near the road, N points.

    pixels : (N, 2) in the original image, pixel centres at integers. rig : (N, 3) metres.
    height : (N,) metres over the road plane; NaN where the frame has none.
    """

    pixels: Array
    rig: Array
    height: Array


@dataclass(frozen=True)
class Profile:
    """What lies in a box; metres, None where it cannot be known.

    points : of the surface, no more than ``max_deviation_m`` off the ground around the box.
    height_max_m, height_min_m : over the road plane of the four wheel contacts. relief_m : their difference.
    elevation_m, depression_m : how far the surface rises and falls from the ground around the box.
    place : (3,) in rig, of what sticks out, or of the whole box. distance_m : from the rig's origin to it.
    spread_m : half the length or width of what is at the place.
    """

    points: int
    height_max_m: float | None = None
    height_min_m: float | None = None
    relief_m: float | None = None
    elevation_m: float | None = None
    depression_m: float | None = None
    place: Array | None = None
    spread_m: float = 0.0
    verdict: str = UNKNOWN

    @property
    def distance_m(self) -> float | None:
        """Horizontal, metres."""
        return None if self.place is None else float(np.hypot(self.place[0], self.place[1]))


def box_profile(view: View, edges: Array, name: str, settings: Mapping[str, Any]) -> Profile:
    """Profile of a box of class ``name`` with edges (4,): x_min, y_min, x_max, y_max in px of ``view``.

    The ground around is fitted to a frame about the box, ``context`` times its sides wide on each side. A
    positive box that does not rise by ``min_elevation_m``, or a negative one that does not fall by
    ``min_depression_m``, is ``doubtful``.
    """
    inside = _within(view.pixels, edges)
    margin = settings["context"] * np.tile(edges[2:] - edges[:2], 2) * (-1, -1, 1, 1)
    around = _within(view.pixels, edges + margin) & ~inside
    rig = view.rig[inside]
    if inside.sum() < settings["min_points"]:
        return Profile(int(inside.sum()))
    if around.sum() < settings["min_points"] or not _surrounded(rig, view.rig[around]):
        return Profile(len(rig), place=np.median(rig, axis=0), spread_m=_spread(rig))
    deviation = fit_ground(view.rig[around]).above(rig)
    surface = np.abs(deviation) <= settings["max_deviation_m"]
    tail = settings["tail_pct"]
    if surface.sum() < settings["min_points"] or 100 * (~surface).mean() > tail:
        # Something stands on the road there, or the ground around is none.
        return Profile(int(surface.sum()), place=np.median(rig, axis=0), spread_m=_spread(rig))
    deviation, rig = deviation[surface], rig[surface]
    elevation, depression = np.percentile(deviation, 100 - tail), -np.percentile(deviation, tail)
    wanted, needed = (
        (elevation, settings["min_elevation_m"])
        if name == "positive"
        else (depression, settings["min_depression_m"])
    )
    found = wanted >= needed
    shown = rig[SIGNS[name] * deviation >= wanted / 2] if found else rig
    height = view.height[inside][surface]
    known = bool(np.isfinite(height).all())
    return Profile(
        int(surface.sum()),
        float(height.max()) if known else None,
        float(height.min()) if known else None,
        float(np.ptp(height)) if known else None,
        float(elevation),
        float(depression),
        shown.mean(axis=0) if found else np.median(rig, axis=0),
        _spread(shown),
        AGREES if found else DOUBTFUL,
    )


def _within(pixels: Array, edges: Array) -> Mask:
    return np.asarray(((pixels >= edges[:2]) & (pixels < edges[2:])).all(axis=1))


def _surrounded(inside: Array, around: Array) -> bool:
    """Whether the ground around reaches beyond the middle half of what is inside, so that none is guessed."""
    low, high = np.percentile(inside[:, :2], (25, 75), axis=0)
    least, most = np.percentile(around[:, :2], (2, 98), axis=0)
    return bool((least <= low).all() and (most >= high).all())


def _spread(points: Array) -> float:
    """Half the longer horizontal side of points (N, 3), metres, but for a tenth of them."""
    low, high = np.percentile(points[:, :2], (5, 95), axis=0)
    return float((high - low).max() / 2)
