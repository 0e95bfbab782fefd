"""The same irregularity in many frames."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def track_boxes(
    frames: Sequence[int],
    names: Sequence[str],
    places: NDArray[np.float64],
    distances: NDArray[np.float64],
    spreads: NDArray[np.float64],
    radius_m: float,
    radius_per_m: float,
) -> NDArray[np.int64]:
    """Track (N,) of each box, numbered from 0 in the order of first frames; -1 without a place.

    A box joins the nearest track of its class that has no box in its frame and lies within ``radius_m`` plus
    ``radius_per_m`` a metre of distance plus half the extent of what was seen: a place is the less sure the
    farther it was seen from, and the middle of a part of a bump is not that of the whole. The nearest sight
    of each irregularity comes first and gives its track the place.

    Parameters
    ----------
    frames, names : (N,) frame and class of each box. places : (N, 2) world, metres; NaN without one.
    distances, spreads : (N,) metres: from where each was seen, and half its extent.
    """
    found = np.full(len(frames), -1, dtype=np.int64)
    tracks: list[tuple[int, set[int]]] = []
    order = [i for i in np.argsort(distances, kind="stable").tolist() if np.isfinite(places[i]).all()]
    for box in order:
        # How far each track is from what was seen, in metres.
        beyond = [
            float(np.hypot(*(places[first] - places[box]))) - max(spreads[first], spreads[box])
            if names[first] == names[box] and frames[box] not in seen
            else np.inf
            for first, seen in tracks
        ]
        nearest = int(np.argmin(beyond)) if beyond else -1
        if beyond and beyond[nearest] <= radius_m + radius_per_m * distances[box]:
            found[box] = nearest
            tracks[nearest][1].add(frames[box])
        else:
            found[box] = len(tracks)
            tracks.append((box, {frames[box]}))
    return _in_order_of_time(found)


def _in_order_of_time(found: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same tracks, numbered as their first boxes come."""
    known = found[found >= 0]
    tracks, first = np.unique(known, return_index=True)
    number = np.full(len(tracks), -1, dtype=np.int64)
    number[tracks[np.argsort(first, kind="stable")]] = np.arange(len(tracks))
    return np.where(found >= 0, number[found] if len(number) else -1, -1)
