"""Figures of the ground truth that true poses and a true calibration give."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mesh_truth import Mesh, RayErrors, floor_ratio
from numpy.typing import NDArray
from static_truth import moving_counts, moving_points, scores, static_by_dufomap

from card.artifacts import default_settings, read_arrays, read_json, read_table, write_table
from card.geometry import Trajectory, apply, from_json
from card.ground_truth.aggregate import aggregate
from card.ground_truth.static_set import prune
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import VoxelMap, build_voxel_map
from card.ground_truth.voxels import VoxelGrid

SINGLE = {"front_votes_min": 1, "front_votes_max": 1, "rear_votes_min": 1, "rear_votes_max": 1}
FIXED = SINGLE | {"front_votes_min": 2, "front_votes_max": 2}
#: The steps of the paper's ablation figure and tables, each as what it changes of the defaults.
ABLATION: Mapping[str, Mapping[str, Any]] = {
    "single_no_crop": {"flow_method": "off", "front_crop": "none", **SINGLE},
    "single": {"flow_method": "off", **SINGLE},
    "fixed": {"flow_method": "off", **FIXED},
    "adaptive": {"flow_method": "off"},
    "literal": {"flow_method": "literal"},
    "submap": {"flow_method": "submap"},
    "voxel_15cm": {"voxel_size_m": 0.15},
    "voxel_20cm": {"voxel_size_m": 0.2},
}
#: Every how many sweeps of a frame's window raw points are compared for the floor of the error along rays.
RAW_STEP = 10


@dataclass(frozen=True)
class Inputs:
    """What `aggregate` reads, with true poses and calibration, and the folder of the drive's truth."""

    recording: Path
    bursts: Path
    frames: Path
    calibration: Path
    ego_mask: Path
    trajectory: Path
    truth: Path

    def drive(self, settings: Mapping[str, Any]) -> Drive:
        trajectory = Trajectory.from_table(read_table(self.trajectory, "trajectory"))
        calibration = read_json(self.calibration, "calibration")
        return Drive(self.recording, self.bursts, calibration, trajectory, settings)


def static_figures(inputs: Inputs, *, ablation: bool = True, dufomap: bool = True) -> dict[str, float]:
    """Accuracies of the static set before MAD, of DUFOMap on the same voxels, and of the ablation."""
    settings = default_settings("ground_truth")
    drive = inputs.drive(settings)
    voxels = map_of(drive, settings)
    moving = moving_counts(drive, inputs.truth, voxels)
    found = scores(voxels, moving, prune(drive, voxels, settings).keys)
    if dufomap:
        found["AA_dufomap"] = scores(voxels, moving, static_by_dufomap(drive, voxels))["AA"]
    for name, changed in ABLATION.items() if ablation else ():
        other = settings | changed
        if {"front_crop", "voxel_size_m"} & set(changed):
            cut = inputs.drive(other)
            other_map = map_of(cut, other)
            truth = moving_counts(cut, inputs.truth, other_map)
            result = scores(other_map, truth, prune(cut, other_map, other).keys)
        else:
            result = scores(voxels, moving, prune(drive, voxels, other).keys)
        found |= {f"{score}_{name}": result[score] for score in ("SA", "DA")}
    return found


def map_of(drive: Drive, settings: Mapping[str, Any]) -> VoxelMap:
    """The voxel map of a drive."""
    bursts = ((i, bool(drive.front[i]), drive.sweep(i).points) for i in range(len(drive)))
    grid = VoxelGrid.around(drive.trajectory, settings["voxel_size_m"])
    return build_voxel_map(bursts, drive.origins, grid, settings)


def frame_figures(inputs: Inputs, mesh: Mesh, frames: int) -> dict[str, float]:
    """Distances to the true surface, and errors along the camera's rays over what sensor noise gives."""
    settings = default_settings("ground_truth")
    drive = inputs.drive(settings)
    rig_from_camera = from_json(
        read_json(inputs.calibration, "calibration")["extrinsics"]["rig_from_camera_left"]
    )
    table = read_table(inputs.frames, "frames")
    table = table.take(np.unique(np.linspace(0, len(table) - 1, frames).astype(int)))
    with tempfile.TemporaryDirectory() as scratch:
        some, out = Path(scratch) / "frames.parquet", Path(scratch) / "ground_truth"
        write_table(some, table, "frames")
        arguments = {name: getattr(inputs, name) for name in _NAMES} | {"frames": some}
        aggregate(
            **arguments,
            out=out,
            report=Path(scratch) / "report.json",
            settings=settings,
            gates=[],
            threads=1,
        )
        coverage = read_table(out / "coverage.parquet", "coverage")
        distances, hidden, kept, raw = [], [], [], []
        for frame, t_ns in zip(table["frame"].to_pylist(), table["t_ns"].to_pylist(), strict=True):
            points = read_arrays(out / f"{frame:06d}.npz", "ground_truth_points")["points"]
            camera = drive.trajectory.at(t_ns) @ rig_from_camera
            world = apply(camera, points.astype(np.float64))
            distances.append(mesh.distance(world))
            hidden.append(mesh.occluded(camera[:3, 3], world))
            kept.append(mesh.ray_errors(camera[:3, 3], world))
            raw.append(mesh.ray_errors(camera[:3, 3], _raw(drive, inputs.truth, t_ns, camera)))
    distance = np.concatenate(distances)
    return {
        "surface_median_mm": 1000 * float(np.median(distance)),
        "surface_p95_mm": 1000 * float(np.percentile(distance, 95)),
        "ray_floor_ratio": floor_ratio(_joined(kept), _joined(raw)),
        "occluded_pct": 100 * float(np.mean(np.concatenate(hidden))),
        "points_per_frame": float(np.median(coverage["points_saved"].to_numpy())),
        "coverage_pct": 100 * float(np.median(coverage["image_share"].to_numpy())),
    }


_NAMES = ("recording", "bursts", "calibration", "ego_mask", "trajectory")


def _raw(drive: Drive, truth: Path, t_ns: int, camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Static points of single sweeps round an image, in front of the camera."""
    near = np.flatnonzero((drive.end_ns > t_ns - 3e9) & (drive.start_ns < t_ns + 13e9))[::RAW_STEP]
    points = [drive.sweep(i).points[~moving_points(drive, truth, i)] for i in near.tolist()]
    cloud = np.concatenate([np.empty((0, 3)), *points])
    ahead = (cloud - camera[:3, 3]) @ camera[:3, 2]
    aside = np.abs((cloud - camera[:3, 3]) @ camera[:3, :2]).max(axis=1)
    return cloud[(ahead > 1) & (aside < ahead)]


def _joined(parts: list[RayErrors]) -> RayErrors:
    names = ("error", "range", "incidence")
    return RayErrors(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
