"""Strata of the split: road topography x place (paper, 'Dataset scale and splits')."""

from collections.abc import Iterable, Mapping
from typing import Any

OFF_ROAD, NEGATIVE, POSITIVE, NONE, UNKNOWN = "off_road", "negative", "positive", "none", "unknown"


def topography(classes: Iterable[str], state: str, off_road: bool) -> str:
    """Topography of one frame from the classes of its boxes and its label state.

    Off-road is labelled per sequence and wins; of two kinds of irregularity in one image the rarer,
    negative, counts. A frame nobody has reviewed is `unknown`, never `none`.
    """
    if off_road:
        return OFF_ROAD
    if state == "not_reviewed":
        return UNKNOWN
    found = set(classes)
    return NEGATIVE if NEGATIVE in found else POSITIVE if POSITIVE in found else NONE


def frame_topographies(
    labels: Mapping[str, list[Any]], states: Mapping[str, list[Any]], off_road: bool
) -> dict[int, str]:
    """Topography of every frame in the columns `states` (frame, state) with boxes `labels` (frame, class)."""
    classes: dict[int, list[str]] = {}
    for frame, name in zip(labels["frame"], labels["class"], strict=True):
        classes.setdefault(frame, []).append(name)
    return {
        frame: topography(classes.get(frame, ()), state, off_road)
        for frame, state in zip(states["frame"], states["state"], strict=True)
    }


def sequence_topography(frames: Iterable[str]) -> str:
    """Topography of a whole sequence: irregular as soon as one frame is (paper, figure of statistics)."""
    found = set(frames)
    ranking = (OFF_ROAD, NEGATIVE, POSITIVE, NONE)
    return next((name for name in ranking if name in found), UNKNOWN)


def stratum(topography: str, place: str) -> str:
    """Name of the stratum."""
    return f"{topography}/{place}"
