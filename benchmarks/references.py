"""Other people's odometry on the scans of a sequence, for the accuracy tables.

KISS-ICP and RKO-LIO live in an environment of their own; the environment variable CARD_REFERENCE_PYTHON names
its interpreter. Without it there are no figures.
"""

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from card.artifacts import default_settings
from card.estimation.odometry import covered_sweeps
from card.geometry import Trajectory, quaternion_from_matrix
from card.poses.inputs import open_imu, open_scans

#: Both take their start for a standstill, and catch up with a car that moves within some scans.
SETTLING_S = 3.0
SYSTEMS = ("kiss_icp", "rko_lio")
SCRIPT = Path(__file__).with_name("reference_odometry.py")


def reference_trajectories(work: Path, sequence: str) -> dict[str, Trajectory]:
    """Trajectories of the rig by system, for a sequence of a work folder."""
    results = work / "results" / sequence
    recording = results / "recording"
    if not recording.is_dir():
        recording = work / "recordings" / sequence
    return odometry_of_others(recording, results / "bursts.parquet", results / "calibration.json")


def odometry_of_others(recording: Path, bursts: Path, calibration: Path) -> dict[str, Trajectory]:
    """Trajectories of the rig by system, without the time they need to settle; none without an interpreter.

    Each gets what it asks for: points in the rig, in which the IMU measures too, from the range our own
    odometry begins at to the greatest they are set up for, in order of time, with a time a point.
    """
    python = os.environ.get("CARD_REFERENCE_PYTHON")
    if not python:
        return {}
    scans = open_scans(recording, bursts, calibration, default_settings("odometry") | {"max_range_m": 100.0})
    imu = open_imu(recording, calibration)
    chosen = covered_sweeps(scans, imu)
    found = {}
    with tempfile.TemporaryDirectory(prefix="card-reference-") as scratch:
        np.savez(Path(scratch, "imu.npz"), t_ns=imu.t_ns, gyro=imu.gyro, accel=imu.accel)
        for i in chosen:
            scan = scans[int(i)]
            order = np.argsort(scan.time_ns, kind="stable")
            arrays = {"points": scan.points[order], "time_ns": scan.time_ns[order]}
            np.savez(Path(scratch, f"{i:06d}.npz"), **arrays)
        for system in SYSTEMS:
            subprocess.run([python, str(SCRIPT), system, scratch], check=True, stdout=subprocess.DEVNULL)
            poses = np.load(Path(scratch, "poses.npy"))
            ends = scans.end_ns[chosen]
            settled = ends >= ends[0] + SETTLING_S * 1e9
            rotation = quaternion_from_matrix(poses[settled, :3, :3])
            found[system] = Trajectory(ends[settled], poses[settled, :3, 3], rotation)
    return found
