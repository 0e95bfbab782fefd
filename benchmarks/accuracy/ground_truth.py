"""The ground truth of each frame against the simulated static surfaces, with estimated poses throughout."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_arrays, read_json, read_table
from card.artifacts.open3d import import_open3d
from card.geometry import Trajectory, apply, from_json

#: Figure: aim, unit, which side is better.
FIGURES = {
    "surface_median_mm_end_to_end": (5.0, "mm", "lower"),
    "surface_p95_mm_end_to_end": (20.0, "mm", "lower"),
    "points_per_frame": (500_000.0, "1", "higher"),
    "coverage_pct": (None, "%", "higher"),
    "occluded_pct": (0.3, "%", "lower"),
}
#: Frames a sequence whose points are compared with the mesh, evenly spaced.
FRAMES = 8
#: A point is occluded if the mesh lies nearer to the camera by more than this, m plus a share of the range:
#: at a grazing angle a few millimetres across the surface are many along the ray.
OCCLUDED_M, OCCLUDED_SHARE = 0.1, 0.02


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Medians over the sequences.

    work : folder with ``results/<id>/``; truth : with ``<id>/`` and ``sessions/<session>/calibration.json``.
    """
    found = [
        figures(work / "results" / sequence, truth, sequence)
        for sequence in sequences
        if (work / "results" / sequence / "ground_truth" / "coverage.parquet").is_file()
        and (truth / sequence / "world.npz").is_file()
    ]
    return [
        {
            "stage": "ground_truth",
            "figure": figure,
            "value": float(np.median([values[figure] for values in found])) if found else None,
            "unit": unit,
            "aim": aim,
            "better": better,
        }
        for figure, (aim, unit, better) in FIGURES.items()
    ]


def figures(results: Path, truth: Path, sequence: str) -> dict[str, float]:
    """The figures of one sequence.

    Points are saved in the estimated camera frame; the true pose and calibration of the camera bring them
    to the true world, so the distances to the mesh hold every error of the chain. Points of movers in the
    keyframe have no surface in the static mesh and count with their full distance.
    """
    calibration = read_json(results / "calibration.json", "calibration")
    session = calibration["session"]["id"]
    true_calibration = read_json(truth / "sessions" / session / "calibration.json", "calibration")
    rig_from_camera = from_json(true_calibration["extrinsics"]["rig_from_camera_left"])
    trajectory = Trajectory.from_table(read_table(truth / sequence / "trajectory.parquet", "trajectory"))
    frames = read_table(results / "frames.parquet", "frames")
    t_ns = dict(zip(frames["frame"].to_pylist(), frames["t_ns"].to_pylist(), strict=True))
    coverage = read_table(results / "ground_truth" / "coverage.parquet", "coverage")
    numbers = coverage["frame"].to_pylist()
    scene = _scene(truth / sequence / "world.npz")
    distances: list[NDArray[np.float64]] = [np.empty(0)]
    occluded: list[NDArray[np.bool_]] = [np.empty(0, dtype=np.bool_)]
    for number in numbers[:: max(1, len(numbers) // FRAMES)]:
        file = results / "ground_truth" / f"{number:06d}.npz"
        points = read_arrays(file, "ground_truth_points")["points"].astype(np.float64)
        world_from_camera = trajectory.at(t_ns[number]) @ rig_from_camera
        world = apply(world_from_camera, points)
        distances.append(_distance(scene, world))
        occluded.append(_occluded(scene, world_from_camera[:3, 3], world))
    distance = np.concatenate(distances)
    return {
        "surface_median_mm_end_to_end": 1000 * float(np.median(distance)),
        "surface_p95_mm_end_to_end": 1000 * float(np.percentile(distance, 95)),
        "points_per_frame": float(np.median(coverage["points_saved"].to_numpy())),
        "coverage_pct": 100 * float(np.median(coverage["image_share"].to_numpy())),
        "occluded_pct": 100 * float(np.mean(np.concatenate(occluded))),
    }


def _scene(world: Path) -> Any:
    o3d = import_open3d()
    with np.load(world) as mesh:
        vertices = o3d.core.Tensor(mesh["vertices"].astype(np.float32))
        triangles = o3d.core.Tensor(mesh["triangles"].astype(np.uint32))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices, triangles)
    return scene


def _distance(scene: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (N,) in metres of world points (N, 3) to the nearest surface."""
    o3d = import_open3d()
    return np.asarray(scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy(), np.float64)


def _occluded(scene: Any, camera: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the mesh hides each world point (N, 3) from the camera (3,)."""
    o3d = import_open3d()
    rays = points - camera
    distance = np.linalg.norm(rays, axis=1)
    origins = np.broadcast_to(camera, rays.shape)
    cast = np.concatenate([origins, rays / distance[:, None]], axis=1).astype(np.float32)
    hit = scene.cast_rays(o3d.core.Tensor(cast))["t_hit"].numpy()
    hidden: NDArray[np.bool_] = hit < distance * (1 - OCCLUDED_SHARE) - OCCLUDED_M
    return hidden
