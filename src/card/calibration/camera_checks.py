"""Whether the board views of a session can make a calibration: each check names the view."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.board_views import BoardViews
from card.calibration.camera_start import agreement
from card.calibration.state import Array
from card.errors import CardError
from card.geometry import inverse
from card.recording.paths import CAMERAS

CELLS = 6
#: Of the views: below it the stereo poses do not agree on anything.
_MOST = 0.5


def coverage_pct(pixels: Array, size: tuple[int, int]) -> float:
    """Share (%) of the 6 x 6 cells of an image that hold a corner of pixels (V, N, 2)."""
    cells = np.clip(pixels.reshape(-1, 2) / size * CELLS, 0, CELLS - 1).astype(int)
    return 100 * len(np.unique(cells @ (1, CELLS))) / CELLS**2


def tilts_deg(camera_from_board: Array) -> Array:
    """Angles (V,) between the boards and the image plane."""
    return np.degrees(np.arccos(np.clip(camera_from_board[:, 2, 2], -1, 1)))


def check_count(views: BoardViews, settings: Mapping[str, Any], where: object) -> None:
    """There are enough views."""
    if len(views) < settings["min_views"]:
        raise CardError(
            "too few views in which both cameras see the board",
            where=where,
            found=f"{len(views)}: {', '.join(views.names)}",
            wanted=f"{settings['min_views']} or more",
        )


def check_coverage(views: BoardViews, settings: Mapping[str, Any], where: object) -> None:
    """The boards were held all over both images."""
    for camera, pixels in zip(CAMERAS, views.pixels, strict=True):
        covered = coverage_pct(pixels, views.size)
        if covered < settings["min_coverage_pct"]:
            off_centre = np.linalg.norm(pixels.mean(axis=1) - np.divide(views.size, 2), axis=1)
            outermost = views.names[int(np.argmax(off_centre))]
            raise CardError(
                f"the boards cover too little of the image of {camera}",
                where=where,
                found=f"{covered:.0f} % of its cells, the outermost board in view {outermost}",
                wanted=f"{settings['min_coverage_pct']:g} % or more: hold the board near the borders too",
            )


def check_tilt(views: BoardViews, left_from_board: Array, settings: Mapping[str, Any], where: object) -> None:
    """The boards were leaned: frontal ones do not tell focal length from distance."""
    tilts = tilts_deg(left_from_board)
    exceeded = float(np.percentile(tilts, 90))
    if exceeded < settings["min_tilt_deg"]:
        most = views.names[int(np.argmax(tilts))]
        raise CardError(
            "the boards all face the camera",
            where=where,
            found=f"a tenth lean by more than {exceeded:.1f} deg, most in view {most}",
            wanted=f"{settings['min_tilt_deg']:g} deg or more: lean and turn the board",
        )


def agreeing_pairs(
    views: BoardViews,
    left_from_board: Array,
    right_from_board: Array,
    settings: Mapping[str, Any],
    where: object,
) -> NDArray[np.bool_]:
    """Which views (V,) agree on the pose of the right camera in the left one.

    Raises
    ------
    CardError
        If most do not, in particular as right images belong to the next or to the previous view; or if the
        right camera is not at the right of the left one.
    """
    pairs = left_from_board @ inverse(right_from_board)
    agreed = agreement(pairs, settings)
    count = len(views)
    if agreed.mean() <= _MOST:
        strange = views.names[int(np.argmin(agreed))]
        for shift in (1, -1):
            other = left_from_board[max(0, -shift) : count - max(0, shift)] @ inverse(
                right_from_board[max(0, shift) : count - max(0, -shift)]
            )
            if agreement(other, settings).mean() > _MOST:
                raise CardError(
                    f"right images are shifted by one pair: that of view {views.names[max(0, shift)]} "
                    f"belongs to view {views.names[max(0, -shift)]}",
                    where=where,
                    wanted="left and right images of one moment under one time",
                )
        raise CardError(
            "left and right images do not show one board",
            where=where,
            found=f"{int(agreed.sum())} of {count} views agree on the stereo pose, view {strange} does not",
            wanted=f"more than {100 * _MOST:.0f} %",
        )
    baseline = float(np.median(pairs[agreed, 0, 3]))
    if baseline <= 0:
        first = views.names[int(np.argmax(agreed))]
        raise CardError(
            "camera_left and camera_right are swapped",
            where=where,
            found=f"baseline {baseline:.3f} m along x of camera_left, view {first}",
            wanted="the right camera at positive x",
        )
    return agreed
