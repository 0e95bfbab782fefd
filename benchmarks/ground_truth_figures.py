"""Figures of the ground truth of a simulated drive with the poses and the calibration at hand."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mesh_truth import Mesh, RayErrors, floor_ratio
from numpy.typing import NDArray
from static_truth import TrueDrive, map_of, scores, static_by_dufomap

from card.artifacts import default_settings, read_json, read_table
from card.geometry import Trajectory, apply, from_json
from card.ground_truth.coverage import frame_window
from card.ground_truth.frame import Frame, build_frame
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.static_set import prune
from card.ground_truth.static_window import StaticWindow

SINGLE = {"front_votes_min": 1, "front_votes_max": 1, "rear_votes_min": 1, "rear_votes_max": 1}
FIXED = SINGLE | {"front_votes_min": 2, "front_votes_max": 2}
#: Settings that leave out, at 0, what decides on movers beside the share of moved votes.
NEXT_TO_VOTES = (
    "moved_fraction_lone",
    "vacated_votes",
    "brief_looks",
    "passes_per_hit",
    "attached_voxels",
    "surrounded_share",
    "accompanied_voxels",
)
#: The steps of the paper's ablation figure and tables that decide on voxels, as changes of the defaults.
ABLATION: Mapping[str, Mapping[str, Any]] = {
    "single_no_crop": {"flow_method": "off", "front_crop": "none", **SINGLE},
    "single": {"flow_method": "off", **SINGLE},
    "fixed": {"flow_method": "off", **FIXED},
    "adaptive": {"flow_method": "off"},
    "literal": {"flow_method": "literal"},
    "submap": {"flow_method": "submap"},
    "votes_alone": dict.fromkeys(NEXT_TO_VOTES, 0),
    # With the rigidity radius in proportion: the paper's is smaller than the diagonals of these voxels.
    "voxel_15cm": {"voxel_size_m": 0.15, "rigidity_m": 0.3},
    "voxel_20cm": {"voxel_size_m": 0.2, "rigidity_m": 0.4},
}
#: Those that decide on the points of a frame.
FRAME_ABLATION: Mapping[str, Mapping[str, Any]] = {
    "no_mad": {"mad_form": "off"},
    "hpr_one_pass": {"hidden_point_removal": "one_pass"},
    "no_hpr": {"hidden_point_removal": "off"},
}
FRAME_SCORES = ("surface_p95_mm", "occluded_pct", "points_per_frame")
#: Every how many sweeps of a frame's window raw points are compared for the floor of the error along rays.
RAW_STEP = 10


#: Seconds round the middle one of a drive's frames within which frames are measured: they share bursts.
SPREAD_NS = 1_000_000_000


@dataclass(frozen=True)
class Inputs:
    """What `aggregate` reads of a drive, and the folder of its truth."""

    recording: Path
    bursts: Path
    frames: Path
    calibration: Path
    ego_mask: Path
    trajectory: Path
    truth: Path
    true_calibration: Path

    def drive(self, settings: Mapping[str, Any]) -> TrueDrive:
        trajectory = Trajectory.from_table(read_table(self.trajectory, "trajectory"))
        calibration = read_json(self.calibration, "calibration")
        return TrueDrive(self.truth, self.recording, self.bursts, calibration, trajectory, settings)


class Measured:
    """A drive built with the default settings, and what its figures are taken from."""

    def __init__(self, inputs: Inputs) -> None:
        self.inputs, self.settings = inputs, default_settings("ground_truth")
        self.drive = inputs.drive(self.settings)
        self.voxels, self.moving = map_of(self.drive, self.settings)
        self.static = prune(self.drive, self.voxels, self.settings)

    def static_figures(self, *, dufomap: bool) -> dict[str, float]:
        """Accuracies of the static set before MAD, and of DUFOMap on the same voxels."""
        found = scores(self.voxels, self.moving, self.static.keys)
        if dufomap:
            keys = static_by_dufomap(self.drive, self.voxels)
            found["AA_dufomap"] = scores(self.voxels, self.moving, keys)["AA"]
        return found

    def ablation(self, mesh: Mesh, frames: int) -> dict[str, float]:
        """SA and DA with each step that decides on voxels changed, figures of frames with the others."""
        found = {}
        for name, changed in ABLATION.items():
            other = self.settings | changed
            if {"front_crop", "voxel_size_m"} & set(changed):
                drive = self.inputs.drive(other)
                voxels, moving = map_of(drive, other)
            else:
                drive, voxels, moving = self.drive, self.voxels, self.moving
            result = scores(voxels, moving, prune(drive, voxels, other).keys)
            found |= {f"{score}_{name}": result[score] for score in ("SA", "DA")}
        for name, changed in FRAME_ABLATION.items():
            result = self.frame_figures(mesh, frames, changed)
            found |= {f"{figure}_{name}": result[figure] for figure in FRAME_SCORES}
        return found

    def frame_figures(self, mesh: Mesh, frames: int, changed: Mapping[str, Any] = {}) -> dict[str, float]:
        """Distances to the true surface, and errors along the camera's rays over what sensor noise gives.

        Points are saved in the camera frame of the poses and calibration at hand; the true ones bring them
        to the true world, so what these err by counts. changed : settings other than the defaults.
        """
        true = Trajectory.from_table(read_table(self.inputs.truth / "trajectory.parquet", "trajectory"))
        calibration = read_json(self.inputs.true_calibration, "calibration")
        rig_from_camera = from_json(calibration["extrinsics"]["rig_from_camera_left"])
        distances, hidden, kept, raw, saved, shares = [], [], [], [], [], []
        for t_ns, frame, size in self._frames(frames, self.settings | changed):
            camera = true.at(t_ns) @ rig_from_camera
            world = apply(camera, frame.points.astype(np.float64))
            distances.append(mesh.distance(world))
            hidden.append(mesh.occluded(camera[:3, 3], world))
            kept.append(mesh.ray_errors(camera[:3, 3], world))
            raw.append(mesh.ray_errors(camera[:3, 3], self._raw(t_ns, camera)))
            saved.append(len(world))
            shares.append(frame.pixels / size)
        distance = np.concatenate(distances)
        return {
            "surface_median_mm": 1000 * float(np.median(distance)),
            "surface_p95_mm": 1000 * float(np.percentile(distance, 95)),
            "ray_floor_ratio": floor_ratio(_joined(kept), _joined(raw)),
            "occluded_pct": 100 * float(np.mean(np.concatenate(hidden))),
            "points_per_frame": float(np.median(saved)),
            "coverage_pct": 100 * float(np.median(shares)),
        }

    def _frames(self, frames: int, settings: Mapping[str, Any]) -> Iterator[tuple[int, Frame, int]]:
        """Times, frames and pixels of the image, of frames round the middle one, made as in `aggregate`."""
        camera = LeftCamera(read_json(self.inputs.calibration, "calibration"), self.inputs.ego_mask)
        table = read_table(self.inputs.frames, "frames")
        t_ns, key = (table[name].to_numpy() for name in ("t_ns", "lidar_front_burst"))
        near = np.flatnonzero(np.abs(t_ns - t_ns[len(t_ns) // 2]) <= SPREAD_NS)
        chosen = near[np.unique(np.linspace(0, len(near) - 1, frames).astype(int))]
        windows = [frame_window(self.drive, int(t_ns[k]), True, settings).bursts for k in chosen]
        window, workspace = StaticWindow(self.drive, self.static, camera, settings), Workspace()
        window.open(np.unique(np.concatenate(windows)))
        for k, bursts in zip(chosen, windows, strict=True):
            front = self.drive.of(True)
            keyframe = int(front[self.drive.index[front] == key[k]][0])
            pose = self.drive.trajectory.at(int(t_ns[k]))
            selection = window.select(bursts, keyframe, pose)
            points = self.drive.sweep(keyframe).points
            made = build_frame(selection, points, pose, camera, settings, workspace)
            yield int(t_ns[k]), made, camera.image.width * camera.image.height

    def _raw(self, t_ns: int, camera: NDArray[np.float64]) -> NDArray[np.float64]:
        """Static points of single sweeps round an image, in front of the camera (4, 4)."""
        drive = self.drive
        near = np.flatnonzero((drive.end_ns > t_ns - 3e9) & (drive.start_ns < t_ns + 13e9))[::RAW_STEP]
        points = [drive.sweep(i).points[~drive.moving(i)] for i in near.tolist()]
        cloud = np.concatenate([np.empty((0, 3)), *points])
        ahead = (cloud - camera[:3, 3]) @ camera[:3, 2]
        aside = np.abs((cloud - camera[:3, 3]) @ camera[:3, :2]).max(axis=1)
        return cloud[(ahead > 1) & (aside < ahead)]


def _joined(parts: list[RayErrors]) -> RayErrors:
    names = ("error", "range", "incidence")
    return RayErrors(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
