"""How sharp a map a trajectory makes of the scans, and whether the road has one height on every visit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.estimation.plane_kernels import voxel_means
from card.estimation.plane_map import PlaneMap, PlaneSettings
from card.estimation.scans import Limits, Scans
from card.geometry import Trajectory, apply
from card.poses.loops import candidates, spaced, travelled
from card.poses.sweep_store import SweepStore, along_trajectory
from card.recording.paths import LIDARS

Array = NDArray[np.float64]
#: Edge of the voxels whose thickness tells the sharpness, m, and of those that thin a sweep.
SHARP_LEAF_M, POINTS_LEAF_M, SCAN_LEAF_M = 0.5, 0.1, 0.5
#: Way around an earlier visit whose sweeps make the map that a later sweep is compared with, m.
AROUND_M = 20.0


def map_figures(
    recording: Path,
    bursts: Any,
    calibration: Mapping[str, Any],
    sensors: Mapping[str, Any],
    trajectory: Trajectory,
    settings: Mapping[str, Any],
) -> list[Figure]:
    """Figures of the map that one LiDAR's sweeps make along a trajectory; None without sweeps or revisits.

    It is the front one, or the rear one of a car without: a map of both would tell of their calibration too.
    """
    thickness: float | None = None
    heights = np.zeros(0)
    present = [lidar for lidar in LIDARS if lidar in bursts["lidar"].to_pylist()]
    if present:
        near, far = settings["quality_range_m"]
        limits = Limits(near, far, (-180.0, 180.0))
        scans = Scans(recording, bursts, calibration, sensors, present[:1], limits)
        poses = trajectory.at(scans.end_ns)
        chosen = spaced(travelled(poses), settings["quality_spacing_m"])
        store = SweepStore(scans, chosen, along_trajectory(trajectory), POINTS_LEAF_M)
        poses = poses[chosen]
        thickness = _thickness(store, poses)
        pairs = candidates(
            poses, settings["quality_spacing_m"], settings["revisit_radius_m"], settings["revisit_min_way_m"]
        )
        # The map of an earlier visit must hold nothing of the later one.
        reach_m = min(AROUND_M, settings["revisit_min_way_m"] / 2)
        heights = np.array([_height(store, poses, *pair, reach_m) for pair in pairs])
        heights = heights[np.isfinite(heights)]
    return [
        Figure(
            "map_thickness_mm",
            thickness,
            "mm",
            f"standard deviation of points across planes of {SHARP_LEAF_M:g} m in the map, median",
        ),
        Figure("revisits", float(len(heights)), "1", "sweeps that are compared with an earlier visit"),
        Figure(
            "revisit_z_mm",
            1e3 * float(np.median(np.abs(heights))) if len(heights) else None,
            "mm",
            "difference in height of the map between two visits of a place, median",
        ),
        Figure(
            "revisit_z_max_mm",
            1e3 * float(np.abs(heights).max()) if len(heights) else None,
            "mm",
            "the same, greatest",
        ),
    ]


def _thickness(store: SweepStore, poses: Array) -> float | None:
    """Median thickness in mm of the planes of all sweeps."""
    grid = PlaneMap(PlaneSettings(leaf_m=SHARP_LEAF_M, min_points=20), horizon=40)
    found: list[Array] = []
    for k, pose in enumerate(poses):
        grid.insert(apply(pose, store.points(k)))
        if k % 20 == 19 or k == len(poses) - 1:
            found.append(grid.thickness())
    values = np.concatenate(found)
    return 1e3 * float(np.median(values)) if len(values) else None


def _height(store: SweepStore, poses: Array, first: int, second: int, reach_m: float) -> float:
    """By how much (m, along z) a later sweep has to move to fit the sweeps around an earlier one.

    NaN where it does not fit.
    """
    way = travelled(poses)
    grid = PlaneMap(PlaneSettings())
    for k in np.flatnonzero(np.abs(way - way[first]) <= reach_m):
        grid.insert(apply(poses[k], store.points(int(k))))
    points = voxel_means(store.points(second), SCAN_LEAF_M)
    found = grid.register(points, poses[second], widen=4.0)
    if found.inlier_fraction < 0.5 * found.known_fraction or found.known_fraction < 0.3:
        return float("nan")
    return float(found.map_from_scan[2, 3] - poses[second][2, 3])
