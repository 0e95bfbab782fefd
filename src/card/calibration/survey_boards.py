"""The board in the images of a survey, and whether it stood still between images and total station."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.board_pose import board_pose
from card.calibration.board_views import BoardViews
from card.calibration.front_sensors import FrontSensors
from card.calibration.survey_alignment import Observed, align_station
from card.calibration.survey_points import Survey
from card.errors import CardError

Array = NDArray[np.float64]


def observed_boards(
    survey: Survey,
    corners: Array,
    marks: Array,
    views: BoardViews,
    sensors: FrontSensors,
    settings: Mapping[str, Any],
) -> tuple[Observed, Array, list[str]]:
    """What is known of the board, its poses (P, 4, 4) in the left camera, a note where corners are left out.

    corners (N, 3), marks (M, 3) : in the board frame, metres.

    Raises
    ------
    CardError
        Naming the pose that no stereo pair shows, or whose images do not fit the cameras.
    """
    chosen = []
    for pose in survey.poses:
        name = f"{survey.name}/{pose}"
        # Of several pairs of a pose, which are named by their times too, the first will do.
        pairs = [i for i, view in enumerate(views.names) if view == name or view.startswith(f"{name}/")]
        if not pairs:
            raise CardError(
                "no stereo pair shows the board", where=name, wanted="one for each pose of the survey"
            )
        chosen.append(pairs[0])
    poses, pixels, notes = [], views.pixels[:, chosen].swapaxes(0, 1).copy(), []
    for number, pose in enumerate(survey.poses):
        found, near = board_pose(sensors, corners, pixels[number], settings["max_corner_px"])
        name, share = f"{survey.name}/{pose}", 100 * float(near.mean())
        if share < settings["min_corners_pct"]:
            raise CardError(
                "the images of the board do not fit the cameras",
                where=name,
                found=f"{share:.0f} % of the corners within {settings['max_corner_px']:g} px",
                wanted=f"at least {settings['min_corners_pct']:g} %",
            )
        if not near.all():
            notes.append(f"{name}: {int((~near).sum())} corners are wrong and not used")
        pixels[number][~near] = np.nan
        poses.append(found)
    return Observed(corners, marks, pixels, survey.marks), np.stack(poses), notes


def check_still(
    survey: Survey,
    observed: Observed,
    boards: Array,
    sensors: FrontSensors,
    sigmas: tuple[float, float],
    settings: Mapping[str, Any],
) -> None:
    """Survey and images must have the board in the same places.

    Raises
    ------
    CardError
        Naming the pose without which they would.
    """
    limit = settings["max_survey_rms_m"]
    rms = align_station(sensors, observed, boards, *sigmas).mark_rms_m
    if rms <= limit:
        return
    without = [
        align_station(sensors, observed.without(pose), np.delete(boards, pose, axis=0), *sigmas).mark_rms_m
        for pose in range(len(boards))
    ]
    best = int(np.argmin(without))
    named = survey.poses[best] if without[best] <= limit else "more than one pose"
    raise CardError(
        f"the board was not where the images show it in {named}",
        where=survey.name,
        found=f"points {1e3 * rms:.1f} mm off, {1e3 * without[best]:.1f} mm without {survey.poses[best]}",
        wanted=f"at most {1e3 * limit:g} mm; was it moved, or its points named in another order?",
    )
