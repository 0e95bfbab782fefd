"""The ground truth at the size of a real drive, over several worlds.

    python benchmarks/field_ground_truth.py de_town_bumps de_gravel_offroad --seeds 1 2 3

prints for each figure the median and the 95th percentile over the drives. What was measured before is not
measured again.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import laspy
import numpy as np
from accuracy.ground_truth import FIGURES
from field import OUT, Field, field_drive
from ground_truth_figures import Inputs, Measured
from mesh_truth import Mesh

from card.artifacts import read_json, write_table
from card.recording.paths import LIDARS

PERIOD_NS = 100_000_000
WORK = OUT.parent / "field_ground_truth"


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
        true_calibration=field.calibration,
    )
    if not inputs.ego_mask.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        bursts = bursts_of(field.recording)
        write_table(inputs.bursts, bursts, "bursts")
        write_table(inputs.frames, _frames(bursts), "frames")
        size = read_json(field.calibration, "calibration")["camera_left_undistorted"]
        cv2.imwrite(str(inputs.ego_mask), np.zeros((size["height"], size["width"]), np.uint8))
    return inputs


def bursts_of(recording: Path) -> dict[str, list[object]]:
    """The columns of schema ``bursts`` of a recording whose points are in the order of firing."""
    rows: dict[str, list[object]] = {
        name: [] for name in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")
    }
    for lidar in LIDARS:
        for number, file in enumerate(sorted((recording / lidar).glob("*.laz"))):
            with laspy.open(file) as reader:
                count = reader.header.point_count
                # The last point tells the end, and its chunk alone is read.
                reader.seek(count - 1)
                last = int(reader.read_points(1)["offset_ns"][0])
            t_ns = int(file.stem)
            values = (lidar, number, t_ns, t_ns + last, count, f"{lidar}/{file.name}")
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


def measured(field: Field, work: Path, frames: int, *, dufomap: bool, ablation: bool) -> dict[str, float]:
    """Figures of one drive with true poses and calibration; kept in `work`, and taken from there."""
    kept = work / f"figures{'-dufomap' * dufomap}{'-ablation' * ablation}.json"
    if not kept.is_file():
        true, mesh = Measured(inputs_of(field, work)), Mesh(field.truth / "world.npz")
        figures = true.static_figures(dufomap=dufomap) | true.frame_figures(mesh, frames)
        if ablation:
            figures |= true.ablation(mesh, frames)
        kept.write_text(json.dumps(figures, indent=1))
    return json.loads(kept.read_text())


def main() -> None:
    """Measure the drives that the command line names, all of a seed before those of the next."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--seconds", type=float, default=45.0)
    parser.add_argument("--frames", type=int, default=2, help="frames a drive that meet the mesh")
    parser.add_argument("--out", type=Path, default=OUT, help="where simulated drives are")
    parser.add_argument("--work", type=Path, default=WORK, help="where results go, and are taken from")
    parser.add_argument("--dufomap", action="store_true")
    parser.add_argument("--ablation", action="store_true")
    options = parser.parse_args()
    found: dict[str, list[dict[str, float]]] = {drive: [] for drive in options.drives}
    for seed in options.seeds:
        for drive, of_drive in found.items():
            field = field_drive(drive, seed, options.seconds, options.out)
            work = options.work / field.folder.name
            figures = measured(
                field, work, options.frames, dufomap=options.dufomap, ablation=options.ablation
            )
            of_drive.append(figures)
            print(drive, seed, {name: round(value, 3) for name, value in figures.items()}, flush=True)
    show_medians(found)


def show_medians(found: Mapping[str, Sequence[Mapping[str, float]]]) -> None:
    """Print median and bad side of each figure of each drive over its seeds."""
    for drive, of_drive in found.items():
        for name in (name for name in FIGURES if name in of_drive[0]):
            values = np.array([figures[name] for figures in of_drive])
            # The bad side: the 95th percentile where lower is better, the 5th where higher is.
            bad = 95 if FIGURES[name][2] == "lower" else 5
            print(f"{drive}  {name:28} {np.median(values):10.4g} {np.percentile(values, bad):10.4g}")


if __name__ == "__main__":
    main()
