"""The poses at the size of a real drive, over several worlds, and other people's odometry beside them.

    python benchmarks/field_poses.py it_town_loop-1-75s it_town_loop-2-75s --references 1

takes the named drives (drive, seed and seconds) from front LiDAR and IMU through both stages, those of the
seeds after --references through KISS-ICP and RKO-LIO too, and prints each figure's median and 95th percentile
a drive over its seeds. Figures of a drive are kept under benchmarks/out/field_poses/: what is there is not
measured again.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from accuracy.poses import trajectory_errors
from field import OUT, Field, field_drive
from references import odometry_of_others
from speed.poses import batch, odometry, write_bursts_table

from card.artifacts import atomic_file, read_table
from card.estimation.imu import Imu
from card.geometry import Trajectory
from card.poses.inputs import open_imu
from card.simulation.imu import RATE_HZ, ImuErrors, ideal_imu

WORK = OUT.parent / "field_poses"
SIGMAS = 3.0


def figures_of(field: Field, folder: Path) -> dict[str, float]:
    """Errors of the trajectory that both stages find, and the share of biases within three sigma, %."""
    if not (folder / "bursts.parquet").is_file():
        write_bursts_table(field.folder, folder)
    odometry(field.folder, folder)
    batch(field.folder, folder)
    true = _trajectory(field.truth / "trajectory.parquet")
    figures = trajectory_errors(_trajectory(folder / "trajectory.parquet"), true)
    nodes = read_table(folder / "nodes.parquet", "pose_graph_nodes")
    imu = open_imu(field.recording, field.calibration)
    off = np.abs(bias_errors(nodes, imu, true))
    return figures | {"biases_within_pct": 100 * float(np.mean(off < SIGMAS))}


def bias_errors(nodes: Any, imu: Imu, true: Trajectory) -> np.ndarray:
    """Errors (6,) of the biases of gyro and accelerometer at the middle node, in standard deviations.

    The true bias is what the corrected IMU has beyond rate and force of the true motion, in the mean of the
    drive. The white noise of that mean is added to the node's sigma.
    """
    inside = (imu.t_ns > true.start_ns + 1e8) & (imu.t_ns < true.end_ns - 1e8)
    ideal = ideal_imu(true, imu.t_ns[inside])
    middle = nodes.num_rows // 2
    errors = []
    for name, measured, wanted, density in (
        ("gyro", imu.gyro[inside], ideal[0], ImuErrors().gyro_noise),
        ("accel", imu.accel[inside], ideal[1], ImuErrors().accel_noise),
    ):
        bias = (measured - wanted).mean(axis=0)
        noise = density / np.sqrt(len(wanted) / RATE_HZ)
        for axis, value in zip("xyz", bias, strict=True):
            found, sigma = (nodes[f"{name}_bias_{part}{axis}"][middle].as_py() for part in ("", "sigma_"))
            errors.append((found - value) / np.hypot(sigma, noise))
    return np.array(errors)


def reference_figures(field: Field, folder: Path) -> dict[str, float]:
    """Errors of the other systems' trajectories, once they have settled."""
    true = _trajectory(field.truth / "trajectory.parquet")
    found = odometry_of_others(field.recording, folder / "bursts.parquet", field.calibration)
    return {
        f"{figure}_{system}": value
        for system, trajectory in found.items()
        for figure, value in trajectory_errors(trajectory, true).items()
    }


def kept(path: Path, measure: Callable[[Field, Path], dict[str, float]], field: Field) -> dict[str, float]:
    """The figures in a file, measured if it is not there; what cannot be determined is NaN."""
    if not path.is_file():
        figures = measure(field, path.parent)
        with atomic_file(path) as partial:
            partial.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return dict(json.loads(path.read_text(encoding="utf-8")))


def main() -> None:
    """Measure the drives that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+", help="<drive>-<seed>-<seconds>s")
    parser.add_argument("--references", type=int, nargs="*", default=[], help="seeds with other systems")
    parser.add_argument("--out", type=Path, default=OUT, help="where simulated drives are")
    parser.add_argument("--work", type=Path, default=WORK, help="where results go")
    options = parser.parse_args()
    found: dict[str, list[Mapping[str, float]]] = defaultdict(list)
    for name in options.drives:
        drive, seed, seconds = name.rsplit("-", 2)
        field = field_drive(drive, int(seed), float(seconds.removesuffix("s")), options.out)
        folder = options.work / name
        folder.mkdir(parents=True, exist_ok=True)
        figures = kept(folder / "figures.json", figures_of, field)
        if int(seed) in options.references:
            figures |= kept(folder / "references.json", reference_figures, field)
        print(name, {figure: round(value, 4) for figure, value in figures.items()}, flush=True)
        found[drive].append(figures)
    for drive, listed in found.items():
        for figure in dict.fromkeys(figure for figures in listed for figure in figures):
            values = np.array([figures[figure] for figures in listed if figure in figures])
            values = values[np.isfinite(values)]
            if len(values):
                # The bad side: the share of biases within their sigmas should be high, all else low.
                bad = np.percentile(values, 5 if figure == "biases_within_pct" else 95)
                print(f"{drive:20} {figure:24} {np.median(values):10.4g} {bad:10.4g}  of {len(values)}")


def _trajectory(path: Path) -> Trajectory:
    return Trajectory.from_table(read_table(path, "trajectory"))


if __name__ == "__main__":
    main()
