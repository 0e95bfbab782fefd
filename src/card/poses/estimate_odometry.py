"""The stage `odometry`: from a recording to odometry.parquet."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import Figure, write_report, write_table
from card.errors import CardError
from card.estimation.odometry import Step, plane_settings, run_odometry
from card.estimation.scan_checks import check_against_scans, check_imu
from card.estimation.scans import Scans
from card.geometry import quaternion_from_matrix
from card.poses.inputs import open_imu, open_scans
from card.recording.description import read_description
from card.recording.paths import imu_path


def estimate_odometry(
    *,
    recording: Path,
    calibration: Path,
    bursts: Path,
    odometry: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Estimate the motion of a drive from its LiDARs and IMU, sweep by sweep.

    Parameters
    ----------
    recording : folder with ``recording.yaml``, ``imu.parquet`` and the sweeps.
    calibration, bursts : artifacts of schemas ``calibration`` and ``bursts``.
    odometry, report : the files to write, of schemas ``odometry_states`` and ``report``.

    Raises
    ------
    CardError
        For an IMU with a gap, in other units or axes, or on another clock; for sweeps without a time a point.
    """
    imu = open_imu(recording, calibration)
    check_imu(imu, settings["max_imu_gap_s"], imu_path(recording))
    description = read_description(recording)
    scans = open_scans(recording, bursts, calibration, settings)
    figures, notes = check_against_scans(scans, imu, settings, plane_settings(settings), imu_path(recording))
    steps = run_odometry(scans, imu, settings)
    found = [step.found for step in steps[1:]]
    registered = [registration for registration in found if registration is not None]
    if not registered:
        raise CardError("no sweep could be registered", where=recording)
    seconds = np.diff([step.state.t_ns for step in steps]) * 1e-9
    way = np.linalg.norm(np.diff([step.state.pose[:3, 3] for step in steps], axis=0), axis=1)
    figures += [
        Figure("length_m", float(way.sum()), "m", "way of the rig"),
        Figure("registered_pct", 100 * len(registered) / len(found), "%", "sweeps that were registered"),
        Figure(
            "inlier_pct",
            100 * float(np.median([r.inlier_fraction for r in registered])),
            "%",
            "points of a sweep that fit the map, median",
        ),
        Figure(
            "plane_rms_mm",
            1e3 * float(np.median([r.rms_m for r in registered])),
            "mm",
            "root mean square distance of those points from their planes, median",
        ),
        Figure("max_step_s", float(seconds.max()), "s", "longest time between sweeps"),
    ]
    write_table(odometry, _odometry_columns(steps, scans), "odometry_states")
    write_report(
        report,
        stage="odometry",
        sequence=description["id"],
        settings=settings,
        inputs={"calibration": calibration, "bursts": bursts, "imu": imu_path(recording)},
        counts={"sweeps": len(steps), "registered": len(registered)},
        figures=figures,
        gates=gates,
        notes=notes,
    )


def _odometry_columns(steps: Sequence[Step], scans: Scans) -> dict[str, Any]:
    """The columns of schema ``odometry_states``."""
    states = [step.state for step in steps]
    pose = np.stack([state.pose for state in states])
    quaternion = quaternion_from_matrix(pose[:, :3, :3])
    columns: dict[str, Any] = {
        "t_ns": np.array([state.t_ns for state in states], dtype=np.int64),
        "lidar": [str(scans.lidar[step.scan]) for step in steps],
        "burst": np.array([scans.burst[step.scan] for step in steps], dtype=np.int32),
        "registered": np.array([step.found is not None for step in steps]),
        "known_fraction": np.array([step.found.known_fraction if step.found else 0.0 for step in steps]),
        "inlier_fraction": np.array([step.found.inlier_fraction if step.found else 0.0 for step in steps]),
        "rms_m": np.array([step.found.rms_m if step.found else 0.0 for step in steps]),
    }
    vectors = {
        "": pose[:, :3, 3],
        "v": np.stack([state.velocity for state in states]),
        "gyro_bias_": np.stack([state.gyro_bias for state in states]),
        "accel_bias_": np.stack([state.accel_bias for state in states]),
        "gravity_": np.stack([state.gravity for state in states]),
    }
    columns |= {
        f"{name}{axis}": values[:, i] for name, values in vectors.items() for i, axis in enumerate("xyz")
    }
    columns |= {f"q{axis}": quaternion[:, i] for i, axis in enumerate("wxyz")}
    information = np.stack([step.found.information if step.found else np.zeros((6, 6)) for step in steps])
    columns |= {f"information_{i}{j}": information[:, i, j] for i in range(6) for j in range(i, 6)}
    return columns
