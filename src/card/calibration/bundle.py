"""The calibration bundle of a session, put together from what its steps estimated."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import read_json, write_json, write_report
from card.calibration.bundle_figures import bundle_figures
from card.calibration.checks import LIDARS, WHEELS, check_bundle
from card.calibration.pose_covariance import chained, of_points
from card.geometry import apply, from_json, to_json
from card.recording.paths import CAMERAS

Document = Mapping[str, Any]


def assemble_bundle(
    *,
    session: str,
    front_lidar: Path,
    rear_and_imu: Path,
    rig_wheels: Path,
    drawing: Path,
    calibration: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write the bundle of a session (schema ``calibration``).

    The wheels come from the day's survey and keep their place to the front LiDAR, whatever session it was.
    The undistorted image is that of the drawing: a mask in it is valid for every session.

    Parameters
    ----------
    session : its name, <day>-start, -mid or -end.
    front_lidar, rear_and_imu : documents of the session (schemas ``front_lidar_calibration`` and
        ``rear_and_imu_calibration``).
    rig_wheels : that of its day (schema ``rig_wheels_calibration``).
    drawing : document ``drawing``.

    Raises
    ------
    CardError
        If the bundle cannot be true of a car; see `check_bundle`.
    """
    steps = {
        "front_lidar": read_json(front_lidar, "front_lidar_calibration"),
        "rear_and_imu": read_json(rear_and_imu, "rear_and_imu_calibration"),
        "rig_wheels": read_json(rig_wheels, "rig_wheels_calibration"),
    }
    bundle = bundle_of(session, steps, read_json(drawing, "drawing"))
    check_bundle(bundle, settings, calibration)
    write_json(calibration, bundle, "calibration")
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs={
            "front_lidar": front_lidar,
            "rear_and_imu": rear_and_imu,
            "rig_wheels": rig_wheels,
            "drawing": drawing,
        },
        counts={"views": bundle["quality"]["views"]},
        figures=bundle_figures(bundle),
        gates=gates,
        notes=bundle["quality"]["failed_limits"],
    )


def bundle_of(session: str, steps: Mapping[str, Document], drawing: Document) -> dict[str, Any]:
    """The document of schema ``calibration``, by the documents of the three steps by name."""
    front, rear, wheels = (steps[name] for name in ("front_lidar", "rear_and_imu", "rig_wheels"))
    extrinsics = {name: rear["extrinsics"][name] for name in ("rig_from_lidar_front", "rig_from_lidar_rear")}
    covariances: dict[str, Any] = {name: rear["covariances"][name] for name in extrinsics}
    rig_from_front = from_json(extrinsics["rig_from_lidar_front"])
    front_covariance = np.array(covariances["rig_from_lidar_front"])
    for camera in CAMERAS:
        front_from_camera = from_json(front[f"lidar_front_from_{camera}"])
        own = np.array(front["covariances"][f"lidar_front_from_{camera}"])
        extrinsics[f"rig_from_{camera}"] = to_json(rig_from_front @ front_from_camera)
        covariances[f"rig_from_{camera}"] = chained(rig_from_front, front_covariance, front_from_camera, own)
        covariances[camera] = front["covariances"][camera]
    surveyed = wheels["lidar_front"]
    points = np.array(
        [surveyed["wheels"][wheel][point] for wheel in WHEELS for point in ("center_m", "contact_m")]
    )
    covariances["wheels"] = of_points(
        rig_from_front, front_covariance, points, np.array(surveyed["covariance"])
    )
    placed = apply(rig_from_front, points)
    return {
        "schema": "calibration",
        "session": {"id": session, "day": session[:10], "mode": "estimate"},
        "cameras": front["cameras"],
        "camera_left_undistorted": drawing["camera_left_undistorted"],
        "extrinsics": extrinsics,
        "wheels": {
            wheel: {"center_m": placed[2 * i], "contact_m": placed[2 * i + 1]}
            for i, wheel in enumerate(WHEELS)
        },
        "lidar_corrections": {name: rear["corrections"][name] for name in LIDARS},
        "imu_corrections": {name: rear["imu"][f"{name}_matrix"] for name in ("gyro", "accel")},
        "covariances": covariances,
        "quality": {
            "stereo_reprojection_px": front["quality"]["reprojection_rms_px"],
            "board_plane_rms_m": front["quality"]["board_plane_rms_m"],
            "views": front["quality"]["views"],
            "wheel_spread_m": 1e-3 * wheels["quality"]["spread_mm"],
            "failed_limits": [
                f"{name}: {reason}" for name, step in steps.items() for reason in step["verdict"]["reasons"]
            ],
        },
    }
