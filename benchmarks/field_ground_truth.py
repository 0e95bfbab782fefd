"""The ground truth at the size of a real drive, over several worlds.

    python benchmarks/field_ground_truth.py de_town_bumps it_town_loop --seeds 1 2 3 --seconds 60

prints for each figure the median and the 95th percentile over the drives.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from accuracy.ground_truth import FIGURES
from field import OUT, Field, field_drive
from ground_truth_figures import Inputs, frame_figures, static_figures
from mesh_truth import Mesh

from card.artifacts import read_json, write_table
from card.recording.laz import read_burst
from card.recording.paths import LIDARS

PERIOD_NS = 100_000_000


def inputs_of(field: Field, folder: Path | None = None) -> Inputs:
    """What `aggregate` reads of a drive without images: a frame every 100 ms, no ego mask.

    The tables go to `folder`, beside the drive if it is not given.
    """
    folder = folder or field.folder / "ground_truth_inputs"
    inputs = Inputs(
        recording=field.recording,
        bursts=folder / "bursts.parquet",
        frames=folder / "frames.parquet",
        calibration=field.calibration,
        ego_mask=folder / "ego_mask.png",
        trajectory=field.truth / "trajectory.parquet",
        truth=field.truth,
    )
    if not inputs.ego_mask.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        bursts = _bursts(field.recording)
        write_table(inputs.bursts, bursts, "bursts")
        write_table(inputs.frames, _frames(bursts), "frames")
        size = read_json(field.calibration, "calibration")["camera_left_undistorted"]
        cv2.imwrite(str(inputs.ego_mask), np.zeros((size["height"], size["width"]), np.uint8))
    return inputs


def _bursts(recording: Path) -> dict[str, list[object]]:
    rows: dict[str, list[object]] = {
        name: [] for name in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")
    }
    for lidar in LIDARS:
        for number, file in enumerate(sorted((recording / lidar).glob("*.laz"))):
            burst = read_burst(file)
            values = (lidar, number, burst.t_ns, burst.end_ns, len(burst), f"{lidar}/{file.name}")
            for column, value in zip(rows.values(), values, strict=True):
                column.append(value)
    return rows


def _frames(bursts: dict[str, list[object]]) -> dict[str, object]:
    """A frame every period of the early part, where the windows are fullest."""
    front = np.array(bursts["lidar"]) == LIDARS[0]
    start, end = np.array(bursts["t_start_ns"])[front], np.array(bursts["t_end_ns"])[front]
    low, high = (int(start[0] + (end[-1] - start[0]) * share) for share in (0.1, 0.4))
    times = np.arange(low, high, PERIOD_NS)
    following = np.searchsorted(end, times, side="right")
    none = [None] * len(times)
    return {
        "frame": np.arange(len(times), dtype=np.int32),
        "t_ns": times,
        "left_file": [f"camera_left/{t}.jpg" for t in times],
        "right_file": none,
        "right_t_ns": none,
        "lidar_front_burst": following.astype(np.int32),
        "lidar_rear_burst": none,
    }


def main() -> None:
    """Measure the drives that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--frames", type=int, default=4, help="frames a drive that meet the mesh; 0 for none")
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--no-ablation", dest="ablation", action="store_false")
    options = parser.parse_args()
    for drive in options.drives:
        found = []
        for seed in options.seeds:
            field = field_drive(drive, seed, options.seconds, options.out)
            inputs = inputs_of(field)
            figures = static_figures(inputs, ablation=options.ablation)
            if options.frames:
                mesh = Mesh(field.truth / "world.npz")
                figures |= frame_figures(inputs, mesh, options.frames)
            print(drive, seed, {name: round(value, 3) for name, value in figures.items()}, flush=True)
            found.append(figures)
        for name in (name for name in FIGURES if name in found[0]):
            values = np.array([of_seed[name] for of_seed in found])
            # The bad side: the 95th percentile where lower is better, the 5th where higher is.
            bad = 95 if FIGURES[name][2] == "lower" else 5
            print(f"{drive}  {name:24} {np.median(values):10.4g} {np.percentile(values, bad):10.4g}")


if __name__ == "__main__":
    main()
