"""The wheels stage with the poses and the calibration that the simulator knows."""

from pathlib import Path

import numpy as np

from card.artifacts import default_settings, read_json, read_table, write_arrays
from card.geometry import Trajectory
from card.ground_truth.static_set import static_voxels
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxels import unpack
from card.wheels import excite

THREADS = 2


def excite_with(
    folder: Path, recording: Path, bursts: Path, frames: Path, calibration: Path, trajectory: Path
) -> Path:
    """Static voxels and wheels of a drive with these inputs, into `folder`; the excitation's path."""
    folder.mkdir(parents=True, exist_ok=True)
    static = static_of(folder, recording, bursts, calibration, trajectory)
    return excite_only(folder, recording, bursts, frames, calibration, trajectory, static)


def static_of(folder: Path, recording: Path, bursts: Path, calibration: Path, trajectory: Path) -> Path:
    """The static voxels of a drive, as the ground truth finds them, in `folder`."""
    settings = default_settings("ground_truth")
    poses = Trajectory.from_table(read_table(trajectory, "trajectory"))
    drive = Drive(recording, bursts, read_json(calibration, "calibration"), poses, settings)
    static = static_voxels(drive, settings)
    arrays = {
        "origin": static.grid.origin,
        "voxel_size": np.float64(static.grid.size),
        "ids": unpack(static.keys).astype(np.int32),
        "counts": static.counts,
    }
    write_arrays(folder / "static_voxels.npz", arrays, "static_voxels")
    return folder / "static_voxels.npz"


def excite_only(
    folder: Path,
    recording: Path,
    bursts: Path,
    frames: Path,
    calibration: Path,
    trajectory: Path,
    static: Path,
) -> Path:
    """The wheels stage with default settings, into `folder`; the excitation's path."""
    excite(
        recording=recording,
        bursts=bursts,
        frames=frames,
        calibration=calibration,
        trajectory=trajectory,
        static_voxels=static,
        wheel_excitation=folder / "wheel_excitation.json",
        road_planes=folder / "road_planes.parquet",
        report=folder / "wheels.report.json",
        settings=default_settings("wheels"),
        gates=[],
        threads=THREADS,
    )
    return folder / "wheel_excitation.json"
