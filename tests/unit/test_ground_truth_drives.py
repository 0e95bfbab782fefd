"""The fast path against the plain one on simulated drives, LiDARs only."""

import numpy as np
import pytest

from card.artifacts import default_settings, write_table
from card.artifacts.masks import write_ego_mask
from card.geometry import apply, inverse
from card.ground_truth.coverage import frame_window
from card.ground_truth.hpr.visible import visible_points
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.reference.hidden_points import visible_by_hull
from card.ground_truth.reference.selection import select
from card.ground_truth.reference.static_cloud import static_cloud
from card.ground_truth.static_set import StaticSet
from card.ground_truth.static_window import StaticWindow
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import build_voxel_map
from card.ground_truth.voxels import VoxelGrid
from card.recording.ingest.bursts import check_bursts
from card.recording.paths import LIDARS
from card.simulation.calibrations import true_calibration
from card.simulation.drives import drive_named
from card.simulation.record import write_sweeps
from card.simulation.scales import scale_named
from card.simulation.sessions import delivered_mask
from card.simulation.simulate import write_description, write_motion
from card.simulation.world import world_of

DEMO = ("de_town_bumps", "de_rural_potholes", "de_gravel_offroad", "it_town_revisit", "it_zero_shot")
FRAMES = {"tiny": [2.0, 2.1, 2.4], "demo": [8.0, 8.1, 10.4, 12.9]}


def opened(folder, name, scale):
    world = world_of(name, drive_named(name), scale_named(scale), 1)
    recording, truth = folder / "recording", folder / "truth"
    recording.mkdir()
    truth.mkdir()
    trajectory = write_motion(world, recording, truth)
    write_sweeps(world, recording, truth)
    write_description(world, recording, cameras=())
    rows = {column: [] for column in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")}
    for lidar in LIDARS:
        files = sorted((recording / lidar).glob("*.laz"))
        times = check_bursts(lidar, files, 10_000)
        columns = (times.start_ns, times.end_ns, times.points)
        values = (
            [lidar] * len(files),
            range(len(files)),
            *columns,
            [f"{lidar}/{file.name}" for file in files],
        )
        for column, more in zip(rows.values(), values, strict=True):
            column.extend(more)
    write_table(folder / "bursts.parquet", rows, "bursts")
    calibration = true_calibration(world.drive.session, 1, scale)
    write_ego_mask(folder / "ego_mask.png", delivered_mask(calibration))
    settings = default_settings("ground_truth")
    drive = Drive(recording, folder / "bursts.parquet", calibration, trajectory, settings)
    return drive, LeftCamera(calibration, folder / "ego_mask.png"), settings


def hit_by_both(drive, settings):
    grid = VoxelGrid.around(drive.trajectory, settings["voxel_size_m"])
    sweeps = ((i, bool(drive.front[i]), drive.sweep(i).points) for i in range(len(drive)))
    voxels = build_voxel_map(sweeps, drive.origins, grid, settings)
    return StaticSet(grid, voxels.keys[voxels.hit_by_both], voxels.counts[voxels.hit_by_both], {})


def same_set(points, radius):
    fast, plain = visible_points(points, radius), visible_by_hull(points, radius)
    assert set(map(tuple, points[fast])) == set(map(tuple, points[plain]))
    return fast


@pytest.mark.parametrize(
    ("name", "scale"),
    [("de_town_bumps", "tiny"), *(pytest.param(name, "demo", marks=pytest.mark.slow) for name in DEMO)],
)
def test_same_frames_as_numpy_and_open3d(tmp_path, name, scale):
    drive, camera, settings = opened(tmp_path, name, scale)
    static = hit_by_both(drive, settings)
    times = [int(drive.start_ns[0]) + round(t * 1e9) for t in FRAMES[scale]]
    windows = [frame_window(drive, t_ns, True, settings).bursts for t_ns in times]
    window = StaticWindow(drive, static, camera, settings)
    window.open(np.unique(np.concatenate(windows)))
    front = drive.of(True)
    for t_ns, bursts in zip(times, windows, strict=True):
        key, pose = int(front[np.searchsorted(drive.end_ns[front], t_ns)]), drive.trajectory.at(t_ns)
        fast = window.select(bursts, key, pose)
        plain = select(static_cloud(drive, static, bursts), key, pose, static, camera, settings)
        assert fast.counts == plain.counts
        assert fast.diameter == plain.diameter
        assert len(fast.points) > 1000
        ordered = [points[np.lexsort(points.T)] for points in (fast.points, plain.points)]
        assert np.array_equal(*ordered)
        keyframe = apply(inverse(pose @ camera.rig_from_camera), drive.sweep(key).points)
        keyframe = keyframe[
            camera.in_view(keyframe, settings["view_margin_rad"], settings["nearest_depth_m"])
        ]
        survivors = same_set(fast.points, settings["hpr_first"] * fast.diameter)
        survivors = survivors[~fast.of_keyframe[survivors]]
        both = np.concatenate([fast.points[survivors], keyframe])
        same_set(both, settings["hpr_second"] * fast.diameter)
