"""Rear LiDAR and IMU of a session from its short drive."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json, read_table, write_json, write_report
from card.calibration.drive.batch import Priors, solve
from card.calibration.drive.document import AXES, figures_of, notes_of, rear_and_imu_document
from card.calibration.drive.inertial_kernels import UPPER
from card.calibration.drive.plane_kernels import CHANNELS, CORRECTIONS
from card.calibration.drive.rays import HeldSweeps, Rays, read_rays
from card.calibration.drive.start import FRONT, first_state, rear_alone
from card.calibration.drive.state import State, corrections_row
from card.errors import CardError
from card.estimation.imu import Imu, ImuNoise, read_imu
from card.estimation.odometry import plane_settings
from card.estimation.scan_checks import check_against_scans, check_imu
from card.estimation.scans import Limits
from card.geometry import from_json
from card.recording.paths import LIDARS, imu_path

Array = NDArray[np.float64]
ALL_ROUND = (-180.0, 180.0)


def calibrate_rear_and_imu(
    *,
    drive: Path,
    front_lidar: Path,
    drawing: Path,
    rear_and_imu: Path,
    report: Path,
    settings: Mapping[str, Any],
    odometry_settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    threads: int,
) -> None:
    """Estimate where the IMU is in the front LiDAR, and the rear LiDAR, and write both.

    One least squares over the drive: returns of both LiDARs on the planes of their common map, the IMU
    between knots of the trajectory, the drawing and the makers' tolerances. The front LiDAR's corrections
    from the boards are its prior.

    Parameters
    ----------
    drive : folder with lidar_front|lidar_rear/<t_ns>.laz and imu.parquet.
    front_lidar : document ``front_lidar_calibration`` of the session.
    drawing : document ``drawing``: mountings with one sigma each.
    rear_and_imu, report : the files to write, of schemas ``rear_and_imu_calibration`` and ``report``.
    settings : those of the stage calibration.  odometry_settings : what the IMU's errors are like, and how
        the first trajectory is made.
    threads : that read sweeps; the bytes do not depend on it, but on how many the linear algebra uses.

    Raises
    ------
    CardError
        For a drive that is too short or lacks a LiDAR; an IMU with a gap, in other units or axes, or on
        another clock; a mounting that is not where the drawing has it.
    """
    own = settings["rear_and_imu"]
    imu = read_imu(read_table(imu_path(drive), "imu"), None)
    limits = Limits(own["min_range_m"], own["max_range_m"], ALL_ROUND)
    rays = read_rays(drive, limits, own["returns_per_sweep"], threads)
    _check_length(rays, imu, own["min_drive_s"], drive)
    check_imu(imu, odometry_settings["max_imu_gap_s"], imu_path(drive))
    drawn = read_json(drawing, "drawing")["extrinsics"]
    boards = read_json(front_lidar, "front_lidar_calibration")
    mounted = np.stack([from_json(drawn[f"rig_from_{name}"]) for name in LIDARS])
    held = HeldSweeps(rays, FRONT, rays.points, mounted[FRONT])
    planes = plane_settings(odometry_settings)
    figures, notes = check_against_scans(held, imu, odometry_settings, planes, imu_path(drive))

    gravity = odometry_settings["gravity_m_s2"]
    corrections = np.stack([corrections_row(boards["corrections"]), np.zeros(CORRECTIONS)])
    state = first_state(rays, imu, mounted, corrections, odometry_settings, own["knot_s"])
    alone = rear_alone(rays, state, state.trajectory(imu, gravity), odometry_settings, own["start_sweeps"])
    priors = _priors(state, drawn, boards["sigmas"], own, ImuNoise.from_settings(odometry_settings))
    begun = replace(state, mounted=np.stack([mounted[FRONT], alone.rig_from_lidar]))
    solution = solve(
        begun, rays.thinned(own["estimate_returns"]), imu, priors, {**own, "gravity_m_s2": gravity}
    )
    document = rear_and_imu_document(solution, priors, alone, rays, imu, own)
    _check_drawing(document, own["max_drawing_sigmas"], drawing)

    write_json(rear_and_imu, document, "rear_and_imu_calibration")
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs={"front_lidar": front_lidar, "drawing": drawing, "imu": imu_path(drive)},
        counts={
            "planes": document["quality"]["planes"],
            "rear_sweeps_registered": alone.registered,
            **{f"inliers_{name}": document["quality"][name]["inliers"] for name in LIDARS},
        },
        figures=[*figures_of(document), *figures],
        gates=gates,
        notes=[*notes, *notes_of(document), *document["verdict"]["reasons"]],
    )


def _priors(
    state: State,
    drawn: Mapping[str, Any],
    board_sigmas: Mapping[str, Any],
    settings: Mapping[str, Any],
    noise: ImuNoise,
) -> Priors:
    """What drawing, boards and makers say; the state's first pose fixes the frame."""
    channel = [settings["channel_range_sigma_m"]] + 2 * [settings["channel_angle_sigma_rad"]]
    maker = np.concatenate([[settings["range_offset_sigma_m"]], np.repeat(channel, CHANNELS)])
    scale, skew = settings["imu_scale_sigma"], settings["imu_skew_sigma_rad"]
    return Priors(
        mounted=state.mounted,
        sigma_rad=np.array([drawn[f"rig_from_{name}"]["sigma_rad"] for name in LIDARS]),
        sigma_m=np.array([drawn[f"rig_from_{name}"]["sigma_m"] for name in LIDARS]),
        corrections=state.corrections,
        corrections_sigma=np.stack([corrections_row(board_sigmas), maker]),
        imu_sigma=np.array([scale if i == j else skew for _ in range(2) for i, j in UPPER]),
        noise=noise,
        start=state.poses[0],
    )


def _check_length(rays: Rays, imu: Imu, least_s: float, drive: Path) -> None:
    start = max(int(imu.t_ns[0]), *(int(rays.start_ns[rays.sweeps_of(i)].min()) for i in range(len(LIDARS))))
    end = min(int(imu.t_ns[-1]), *(int(rays.end_ns[rays.sweeps_of(i)].max()) for i in range(len(LIDARS))))
    if end - start < least_s * 1e9:
        raise CardError(
            "session drive too short",
            where=drive,
            found=f"{max(end - start, 0) * 1e-9:.2f} s of both LiDARs and the IMU",
            wanted=f"at least {least_s:g} s",
        )


def _check_drawing(document: Mapping[str, Any], most: float, drawing: Path) -> None:
    """No pose is farther off the drawing than its sigmas allow; the farthest is named."""
    off = {
        (pose, part, k): abs(value or 0.0)
        for name, pose in (("imu", "rig_from_lidar_front"), ("rear", "lidar_front_from_lidar_rear"))
        for part in ("rotation", "translation")
        for k, value in enumerate(document["observability"][name][f"{part}_off_sigmas"])
    }
    pose, part, k = max(off, key=lambda entry: off[entry])
    if off[pose, part, k] > most:
        raise CardError(
            f"{part} of {pose} is not that of the drawing",
            where=drawing,
            found=f"{off[pose, part, k]:.1f} standard deviations off, in {AXES[k]}",
            wanted=f"at most {most:g}; was a sensor moved, or is it the drawing of another car?",
        )
