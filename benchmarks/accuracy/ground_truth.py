"""The ground truth of simulated drives: as released, and built again with true poses and calibration."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from ground_truth_figures import ABLATION, FRAME_ABLATION, FRAME_SCORES, Inputs, Measured
from mesh_truth import Mesh
from numpy.typing import NDArray

from card.artifacts import read_arrays, read_json, read_table
from card.geometry import Trajectory, apply, from_json

#: Figure: aim, unit, which side is better.
FIGURES: dict[str, tuple[float | None, str, str]] = {
    "surface_median_mm": (2.0, "mm", "lower"),
    "surface_p95_mm": (8.0, "mm", "lower"),
    "surface_median_mm_end_to_end": (5.0, "mm", "lower"),
    "surface_p95_mm_end_to_end": (20.0, "mm", "lower"),
    "ray_floor_ratio": (1.2, "1", "lower"),
    "SA": (98.5, "%", "higher"),
    "DA": (99.7, "%", "higher"),
    "AA": (None, "%", "higher"),
    "HA": (None, "%", "higher"),
    "point_DA": (99.0, "%", "higher"),
    "point_DA_two_lidars": (None, "%", "higher"),
    "AA_dufomap": (None, "%", "higher"),
    "dynamic_pct": (None, "%", "lower"),
    "occluded_pct": (0.3, "%", "lower"),
    "points_per_frame": (500_000.0, "1", "higher"),
    "coverage_pct": (None, "%", "higher"),
    **{f"{score}_{name}": (None, "%", "higher") for name in ABLATION for score in ("SA", "DA")},
}
FIGURES |= {
    f"{score}_{name}": (None, *FIGURES[score][1:]) for name in FRAME_ABLATION for score in FRAME_SCORES
}
#: Frames a sequence whose points are compared with the mesh, evenly spaced.
FRAMES = 8


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Medians over the sequences.

    work : folder with ``results/<id>/``; truth : with ``<id>/`` and ``sessions/<session>/calibration.json``.
    """
    found = [
        figures(work, truth, sequence)
        for sequence in sequences
        if (work / "results" / sequence / "ground_truth" / "coverage.parquet").is_file()
        and (truth / sequence / "world.npz").is_file()
    ]
    return table_rows(found)


def table_rows(found: Sequence[dict[str, float]]) -> list[dict[str, Any]]:
    """One row a figure: the median over drives."""

    def median(figure: str) -> float | None:
        values = [of_drive[figure] for of_drive in found if figure in of_drive]
        return float(np.median(values)) if values else None

    return [
        {
            "stage": "ground_truth",
            "figure": figure,
            "value": median(figure),
            "unit": unit,
            "aim": aim,
            "better": better,
        }
        for figure, (aim, unit, better) in FIGURES.items()
    ]


def figures(work: Path, truth: Path, sequence: str) -> dict[str, float]:
    """All figures of one sequence of a work folder."""
    results = work / "results" / sequence
    calibration = read_json(results / "calibration.json", "calibration")
    bag = results / "recording"
    true_calibration = truth / "sessions" / calibration["session"]["id"] / "calibration.json"
    inputs = Inputs(
        recording=bag if bag.is_dir() else work / "recordings" / sequence,
        bursts=results / "bursts.parquet",
        frames=results / "frames.parquet",
        calibration=true_calibration,
        ego_mask=results / "ego_mask.png",
        trajectory=truth / sequence / "trajectory.parquet",
        truth=truth / sequence,
        true_calibration=true_calibration,
    )
    mesh = Mesh(truth / sequence / "world.npz")
    true = Measured(inputs)
    return {
        **released(results, inputs, mesh),
        **true.static_figures(dufomap=True),
        **true.frame_figures(mesh, FRAMES),
        **true.ablation(mesh, FRAMES),
    }


def released(results: Path, inputs: Inputs, mesh: Mesh) -> dict[str, float]:
    """Figures of the points as a release has them.

    Points are saved in the estimated camera frame; the true pose and calibration of the camera bring them
    to the true world, so the distances to the mesh hold every error of the chain. Points of movers in the
    keyframe have no surface in the static mesh and count with their full distance.
    """
    extrinsics = read_json(inputs.calibration, "calibration")["extrinsics"]
    rig_from_camera = from_json(extrinsics["rig_from_camera_left"])
    trajectory = Trajectory.from_table(read_table(inputs.trajectory, "trajectory"))
    frames = read_table(inputs.frames, "frames")
    t_ns = dict(zip(frames["frame"].to_pylist(), frames["t_ns"].to_pylist(), strict=True))
    coverage = read_table(results / "ground_truth" / "coverage.parquet", "coverage")
    numbers = coverage["frame"].to_pylist()
    distances: list[NDArray[np.float64]] = [np.empty(0)]
    occluded: list[NDArray[np.bool_]] = [np.empty(0, dtype=np.bool_)]
    for number in numbers[:: max(1, len(numbers) // FRAMES)]:
        file = results / "ground_truth" / f"{number:06d}.npz"
        points = read_arrays(file, "ground_truth_points")["points"].astype(np.float64)
        world_from_camera = trajectory.at(t_ns[number]) @ rig_from_camera
        world = apply(world_from_camera, points)
        distances.append(mesh.distance(world))
        occluded.append(mesh.occluded(world_from_camera[:3, 3], world))
    distance = np.concatenate(distances)
    return {
        "surface_median_mm_end_to_end": 1000 * float(np.median(distance)),
        "surface_p95_mm_end_to_end": 1000 * float(np.percentile(distance, 95)),
        "points_per_frame": float(np.median(coverage["points_saved"].to_numpy())),
        "coverage_pct": 100 * float(np.median(coverage["image_share"].to_numpy())),
        "occluded_pct": 100 * float(np.mean(np.concatenate(occluded))),
    }
