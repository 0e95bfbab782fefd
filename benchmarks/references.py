"""Other people's odometry on the scans of a sequence, for the accuracy tables.

KISS-ICP and RKO-LIO live in an environment of their own; the environment variable CARD_REFERENCE_PYTHON names
its interpreter. Without it there are no figures.
"""

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from card.artifacts import default_settings, read_table
from card.estimation.imu import read_imu
from card.geometry import Trajectory, quaternion_from_matrix
from card.poses.estimate_odometry import open_scans
from card.recording.paths import imu_path

SYSTEMS = ("kiss_icp", "rko_lio")
SCRIPT = Path(__file__).with_name("reference_odometry.py")


def reference_trajectories(work: Path, sequence: str) -> dict[str, Trajectory]:
    """Trajectories of the rig by system; none where no interpreter is named."""
    python = os.environ.get("CARD_REFERENCE_PYTHON")
    if not python:
        return {}
    results = work / "results" / sequence
    recording = results / "recording"
    if not recording.is_dir():
        recording = work / "recordings" / sequence
    scans = open_scans(
        recording, results / "bursts.parquet", results / "calibration.json", default_settings("odometry")
    )
    imu = read_imu(read_table(imu_path(recording), "imu"))
    found = {}
    with tempfile.TemporaryDirectory(prefix="card-reference-") as scratch:
        np.savez(Path(scratch, "imu.npz"), t_ns=imu.t_ns, gyro=imu.gyro, accel=imu.accel)
        for i in range(len(scans)):
            scan = scans[i]
            order = np.argsort(scan.time_ns, kind="stable")
            arrays = {"points": scan.points[order], "time_ns": scan.time_ns[order]}
            np.savez(Path(scratch, f"{i:06d}.npz"), **arrays)
        for system in SYSTEMS:
            subprocess.run([python, str(SCRIPT), system, scratch], check=True)
            poses = np.load(Path(scratch, "poses.npy"))
            rotation = quaternion_from_matrix(poses[:, :3, :3])
            found[system] = Trajectory(scans.end_ns, poses[:, :3, 3], rotation)
    return found
