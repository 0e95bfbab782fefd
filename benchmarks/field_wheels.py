"""Wheel excitation at the size of a real drive, with poses estimated from its sweeps and with the true ones.

    python benchmarks/field_wheels.py de_town_bumps-1-45s de_gravel_offroad-1-45s

takes the named drives (drive, seed and seconds) from front LiDAR and IMU to the excitation, and prints the
figures of benchmarks/accuracy/wheels.py a drive and over all of them. Poses and static voxels that a run left
under --work are taken as they are.
"""

import argparse
from pathlib import Path

import numpy as np
from accuracy.wheels import figures
from field import OUT, Field, field_drive
from field_ground_truth import inputs_of
from ground_truth_figures import Inputs
from speed.poses import batch, odometry
from wheel_errors import WheelErrors, wheel_errors
from wheel_inputs import excite_only, static_of

from card.artifacts import default_settings
from card.poses.take_refined import take_refined

WORK = OUT.parent / "field_wheels"


def estimated(field: Field, inputs: Inputs, folder: Path) -> Path:
    """The trajectory that the poses stage estimates of a drive with the calibration at hand, in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / "poses.parquet").is_file():
        return folder / "poses.parquet"
    odometry(field.folder, folder, inputs.bursts, inputs.calibration)
    batch(field.folder, folder, inputs.bursts, inputs.calibration)
    take_refined(
        refined=folder / "trajectory.parquet",
        recording=inputs.recording,
        calibration=inputs.calibration,
        bursts=inputs.bursts,
        frames=inputs.frames,
        trajectory=folder / "poses.parquet",
        poses=folder / "poses.json",
        report=folder / "poses.report.json",
        settings=default_settings("poses"),
        gates=[],
    )
    return folder / "poses.parquet"


def errors_with(trajectory: Path, inputs: Inputs, folder: Path) -> WheelErrors:
    """Errors of the wheels of a drive with a trajectory and the true calibration."""
    folder.mkdir(parents=True, exist_ok=True)
    static = folder / "static_voxels.npz"
    if not static.is_file():
        static_of(folder, inputs.recording, inputs.bursts, inputs.calibration, trajectory)
    drive = inputs.recording, inputs.bursts, inputs.frames, inputs.calibration
    return wheel_errors(excite_only(folder, *drive, trajectory, static), trajectory, inputs.truth)


def main() -> None:
    """Measure the drives that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+", help="<drive>-<seed>-<seconds>s")
    parser.add_argument("--out", type=Path, default=OUT, help="where simulated drives are")
    parser.add_argument("--work", type=Path, default=WORK, help="where results go")
    parser.add_argument("--poses", nargs="+", choices=("refined", "true"), default=["refined", "true"])
    options = parser.parse_args()
    found: dict[str, list[WheelErrors]] = {poses: [] for poses in options.poses}
    for name in options.drives:
        drive, seed, seconds = name.rsplit("-", 2)
        field = field_drive(drive, int(seed), float(seconds.removesuffix("s")), options.out)
        inputs = inputs_of(field, options.work / name)
        for poses in options.poses:
            folder = options.work / name / poses
            trajectory = inputs.trajectory if poses == "true" else estimated(field, inputs, folder)
            errors = errors_with(trajectory, inputs, folder)
            found[poses].append(errors)
            _show(name, poses, errors)
    for poses, parts in found.items():
        _show("all", poses, WheelErrors.joined(parts))


def _show(name: str, poses: str, errors: WheelErrors) -> None:
    values = {figure: np.nan if value is None else value for figure, value in figures(errors).items()}
    line = "  ".join(f"{figure} {value:.2f}" for figure, value in values.items())
    print(f"{name:24} {poses:8} {line}", flush=True)


if __name__ == "__main__":
    main()
