"""Which other images show what a takedown is about: a list for somebody to decide on."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import apply
from card.packaging.modalities import CAMERAS
from card.packaging.reader import Frame, Release

Array = NDArray[np.float64]


def neighbours(
    release: Release,
    sequence: str,
    number: int,
    settings: Mapping[str, Any],
    region: tuple[str, Sequence[float]] | None = None,
) -> list[dict[str, Any]]:
    """Images of the sequence that may show the same: {frame, camera, why, share, box}, by frame.

    The ground truth of the frame, of a `region` only (camera and x_min, y_min, x_max, y_max in pixels) what
    lies in it, is seen from every other image's pose; what stands between is not looked at, so the list is
    rather too long. Since people move, all images within `neighbour_s` seconds are on it too.

    Parameters
    ----------
    settings : of packaging: neighbour_share, neighbour_s, neighbour_points.

    Returns `why` as `same moment`, `view` or `time`, `share` of the points in view and the pixels `box` they
    take; both None without. CardError if the release has no such frame.
    """
    frames = list(release.iterate(sequence=sequence))
    asked = next((frame for frame in frames if frame.number == number), None)
    if asked is None:
        raise CardError("no such frame in the release", where=sequence, found=number)
    points = _points(release, asked, region, settings["neighbour_points"])
    found = []
    for frame in frames:
        near = abs(frame.row["t_ns"] - asked.row["t_ns"]) <= 1e9 * settings["neighbour_s"]
        for camera in CAMERAS:
            if not frame.row[f"has_{camera}"] or (frame is asked and region and camera == region[0]):
                continue
            share, box = _view(release, frame, camera, points)
            if frame is asked:
                why = "same moment"
            elif share is not None and share >= settings["neighbour_share"]:
                why = "view"
            elif near:
                why = "time"
            else:
                continue
            found.append({"frame": frame.number, "camera": camera, "why": why, "share": share, "box": box})
    return found


def _points(release: Release, frame: Frame, region: tuple[str, Sequence[float]] | None, most: int) -> Array:
    """Points (N, 3) in world of what the takedown is about; none without ground truth or poses."""
    if not frame.row["has_ground_truth"]:
        return np.zeros((0, 3))
    points = np.asarray(frame.points(), dtype=np.float64)
    if region is not None:
        camera, (x_min, y_min, x_max, y_max) = region
        seen = apply(frame.transform(f"{camera}_from_camera_left"), points)
        u, v = release.rig(frame.sequence).camera(camera).project(seen).T
        # The edges of a region lie half a pixel outside its outermost pixel centres.
        inside = (u >= x_min - 0.5) & (u < x_max - 0.5) & (v >= y_min - 0.5) & (v < y_max - 0.5)
        points = points[inside]
    points = points[:: max(1, len(points) // most)]
    try:
        return apply(frame.transform("world_from_camera_left"), points)
    except CardError:
        return np.zeros((0, 3))


def _view(release: Release, frame: Frame, camera: str, points: Array) -> tuple[float | None, Any]:
    """Share of the points in an image and the pixels they take; None where that is not known."""
    if not len(points):
        return None, None
    try:
        seen = apply(frame.transform(f"{camera}_from_world"), points)
    except CardError:
        return None, None
    model = release.rig(frame.sequence).camera(camera)
    pixels = model.project(seen)
    pixels = pixels[model.contains(pixels)]
    if not len(pixels):
        return 0.0, None
    low, high = np.floor(pixels.min(axis=0) + 0.5), np.floor(pixels.max(axis=0) + 0.5) + 1
    return len(pixels) / len(points), [int(value) for value in (*low, *high)]
