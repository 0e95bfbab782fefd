"""The document of a rig-wheel calibration."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.front_sensors import FrontSensors
from card.calibration.state import step_between
from card.calibration.survey_alignment import Alignment
from card.calibration.survey_points import WHEELS, Survey
from card.calibration.verdict import Limit, verdict
from card.calibration.wheel_mean import Wheels
from card.geometry import to_json

Array = NDArray[np.float64]

_CONTACTS = slice(1, None, 2)


def rig_wheels_document(
    surveys: Sequence[Survey],
    alignments: Sequence[Alignment],
    wheels: Wheels,
    sensors: FrontSensors,
    sigmas: tuple[float, float],
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    """The document of schema ``rig_wheels_calibration``.

    sigmas : scatter of corners, px, and of surveyed coordinates, m.
    """
    off = np.linalg.norm(wheels.each_m - wheels.points_m, axis=-1)
    in_camera, in_lidar = wheels.in_camera(sensors), wheels.in_lidar(sensors)
    sigma_m = np.sqrt(np.diag(in_lidar[1])).reshape(-1, 3)
    quality = {
        "points": int(sum(np.isfinite(survey.marks[..., 0]).sum() for survey in surveys)),
        "survey_sigma_mm": 1e3 * sigmas[1],
        "reprojection_rms_px": float(np.sqrt(2)) * sigmas[0],
        "spread_mm": 1e3 * float(off.max()),
        "contact_sigma_mm": 1e3 * float(sigma_m[_CONTACTS].max()),
    }
    return {
        "schema": "rig_wheels_calibration",
        "camera_left": _wheels(*in_camera),
        "lidar_front": _wheels(*in_lidar),
        "surveys": [
            _survey(survey, alignment, points, settings)
            for survey, alignment, points in zip(surveys, alignments, off, strict=True)
        ],
        "quality": quality,
        "verdict": verdict(
            Limit("spread_mm", quality["spread_mm"], settings["max_spread_mm"]),
            Limit("contact_sigma_mm", quality["contact_sigma_mm"], settings["max_contact_sigma_mm"]),
            Limit("reprojection_rms_px", quality["reprojection_rms_px"], settings["max_reprojection_rms_px"]),
        ),
    }


def _wheels(points_m: Array, covariance: Array) -> dict[str, Any]:
    wheels = {
        wheel: {"center_m": points_m[2 * i].tolist(), "contact_m": points_m[2 * i + 1].tolist()}
        for i, wheel in enumerate(WHEELS)
    }
    return {"wheels": wheels, "covariance": (0.5 * (covariance + covariance.T)).tolist()}


def _survey(survey: Survey, alignment: Alignment, off: Any, settings: Mapping[str, Any]) -> dict[str, Any]:
    step = step_between(alignment.left_from_station, alignment.closed_form)
    marks = np.linalg.norm(alignment.mark_m.reshape(-1, 3), axis=1)
    return {
        "survey": survey.name,
        "poses": list(survey.poses),
        "left_from_station": to_json(alignment.left_from_station),
        "points": len(marks),
        "inliers": int((marks <= settings["max_mark_misfit_m"]).sum()),
        "mark_rms_mm": 1e3 * alignment.mark_rms_m,
        "reprojection_rms_px": float(np.sqrt(2)) * alignment.corner_rms_px,
        "wheel_rms_mm": 1e3 * float(np.sqrt(np.mean(off**2))),
        "closed_form_deg": float(np.degrees(np.linalg.norm(step[3:]))),
        "closed_form_mm": 1e3 * float(np.linalg.norm(step[:3])),
    }
