"""What a drive's length costs the ground truth: CPU-seconds and peak memory of its voxel map and frames.

    python benchmarks/ground_truth_length.py 1 3 10       minutes, each in a process of its own

A simulated minute at full scale is driven again and again, each lap further on, so that every lap meets new
voxels. What grows with the drive is the state of its voxels; a frame must not.
"""

import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from field import OUT
from full_scale import FullScale, open_drive
from numpy.typing import NDArray
from own_process import alone, peak_gb

from card.artifacts import atomic_folder, progress
from card.ground_truth.aggregate import BLOCK_FRAMES
from card.ground_truth.coverage import frame_window
from card.ground_truth.frame import build_frame
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.static_set import StaticSet
from card.ground_truth.static_window import StaticWindow
from card.ground_truth.voxel_map import build_voxel_map
from card.ground_truth.voxels import VoxelGrid

LAP_NS = 60_000_000_000
#: From one lap to the next, metres: beyond the reach of the LiDARs.
SHIFT_M = np.array([0.0, 1500.03, 0.0])
FRAMES = 120


class Laps:
    """The bursts of a drive's first minute, again and again; what the stage asks of a `Drive`."""

    def __init__(self, scene: FullScale, laps: int) -> None:
        drive, self.trajectory = scene.drive, scene.drive.trajectory
        self._own = np.flatnonzero(drive.end_ns < drive.start_ns[0] + LAP_NS)
        self._folder = _points_on_disk(drive, self._own)
        lap = np.repeat(np.arange(laps), len(self._own))
        own = np.tile(self._own, laps)
        self.start_ns = drive.start_ns[own] + lap * LAP_NS
        self.end_ns = drive.end_ns[own] + lap * LAP_NS
        self.front, self.origins = drive.front[own], drive.origins[own] + lap[:, None] * SHIFT_M
        path = self.trajectory.translation_m
        self.extent = SimpleNamespace(translation_m=np.concatenate([path, path + (laps - 1) * SHIFT_M]))

    def __len__(self) -> int:
        return len(self.front)

    def of(self, front: bool) -> NDArray[np.int64]:
        return np.flatnonzero(self.front == front)

    def sweep(self, i: int) -> SimpleNamespace:
        lap, k = divmod(i, len(self._own))
        return SimpleNamespace(points=np.load(self._folder / f"{self._own[k]}.npy") + lap * SHIFT_M)

    def pose(self, t_ns: int) -> NDArray[np.float64]:
        lap, since = divmod(t_ns - int(self.start_ns[0]), LAP_NS)
        pose = self.trajectory.at(int(self.start_ns[0]) + since).copy()
        pose[:3, 3] += lap * SHIFT_M
        return pose


def measure(minutes: int) -> dict[str, Any]:
    """CPU-seconds of the map and of a frame, and the peak of this process's memory, GB."""
    with tempfile.TemporaryDirectory(prefix="card-bench-") as scratch:
        scene = open_drive(Path(scratch))
        scene.drive.keep(0)
        drive = Laps(scene, minutes)
        before = time.process_time()
        grid = VoxelGrid.around(drive.extent, scene.settings["voxel_size_m"])
        sweeps = (
            (i, bool(drive.front[i]), drive.sweep(i).points) for i in progress(range(len(drive)), "map")
        )
        voxels = build_voxel_map(sweeps, drive.origins, grid, scene.settings)
        mapped = time.process_time() - before
        both = voxels.hit_by_both
        static = StaticSet(grid, voxels.keys[both], voxels.counts[both], {})
        found = {"minutes": minutes, "bursts": len(drive), "voxels": len(voxels.keys), "map_cpu_s": mapped}
        del voxels, both
        map_gb = peak_gb()
        before = time.process_time()
        _make_frames(scene, drive, static)
        frame = (time.process_time() - before) / FRAMES
        return found | {"frame_cpu_s": frame, "map_peak_gb": map_gb, "peak_gb": peak_gb()}


def in_a_process(minutes: int) -> dict[str, Any]:
    """`measure` in a process of its own, so that its peak is its own."""
    return alone(measure, minutes)[0]


def _make_frames(scene: FullScale, drive: Laps, static: StaticSet) -> None:
    """Frames from the middle of the drive; reading from bursts is not in it."""
    middle = int(drive.start_ns[0]) + (len(drive) // len(drive._own)) * LAP_NS // 2
    window = StaticWindow(drive, static, scene.camera, scene.settings)
    workspace = Workspace()
    for start in range(0, FRAMES, BLOCK_FRAMES):
        times = [middle + k * 100_000_000 for k in range(start, min(start + BLOCK_FRAMES, FRAMES))]
        windows = [frame_window(drive, t_ns, True, scene.settings).bursts for t_ns in times]
        window.open(np.unique(np.concatenate(windows)))
        for t_ns, bursts in zip(times, windows, strict=True):
            key = int(bursts[0])
            chosen = window.select(bursts, key, drive.pose(t_ns))
            points = drive.sweep(key).points
            build_frame(chosen, points, drive.pose(t_ns), scene.camera, scene.settings, workspace)


def _points_on_disk(drive: Any, bursts: NDArray[np.int64]) -> Path:
    folder = OUT.parent / "world points"
    if not folder.is_dir():
        with atomic_folder(folder) as partial:
            for i in progress(bursts, "world points"):
                np.save(partial / f"{i}.npy", drive.sweep(int(i)).points)
    return folder


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        found = in_a_process(int(argument))
        print("  ".join(f"{k} {v:.4g}" for k, v in found.items()), flush=True)
