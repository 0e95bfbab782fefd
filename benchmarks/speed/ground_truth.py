"""A frame's ground truth at full scale, from bursts on disk to the saved cloud, against two naive ways.

The static set is every voxel that both LiDARs hit; votes would take away a hundredth of it. The naive way
reads the bursts of each frame's windows anew, with laspy and a pose a point in numpy; the tuned one keeps
world points in memory, and so reads a burst once. Neither writes. They keep all points that cleaning leaves,
as the paper does. The ratios are those of the frame as the stage makes it, of no more points than the image
tells apart, and, beside them, of one that keeps all points as well.
"""

import resource
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import laspy
import numpy as np
from full_scale import open_drive
from ground_truth_length import in_a_process
from naive_frame import naive_frame

from card.artifacts import progress, write_arrays
from card.geometry import apply, inverse
from card.ground_truth import frame as frame_stage
from card.ground_truth.aggregate import BLOCK_FRAMES, FRAME_POINTS
from card.ground_truth.coverage import frame_window
from card.ground_truth.hidden_points import two_pass_visibility
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.reference.hidden_points import visible_by_hull
from card.ground_truth.static_set import StaticSet
from card.ground_truth.static_window import StaticWindow
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import build_voxel_map
from card.ground_truth.voxels import VoxelGrid

#: The windows of all these frames lie within the drive.
FIRST_S, FRAMES, PERIOD_S = 5.0, 300, 0.1
#: Of these the frames that are made once more, with all points.
FRAMES_ALL_POINTS = 30
#: Bursts that the plain way reads; its time is scaled to all of them.
PLAIN_BURSTS = 20
READ, VISIBILITY = "read bursts, order by voxel", "of these, visibility"


class Bench:
    """One drive, its static set, and CPU-seconds by stage, a value a frame."""

    def __init__(self, scratch: Path) -> None:
        opened = open_drive(scratch)
        self.drive, self.camera, self.settings = opened.drive, opened.camera, opened.settings
        self.static = _hit_by_both(self.drive, self.settings)
        self.scratch = scratch
        start = int(self.drive.start_ns[0])
        self.times = [start + round((FIRST_S + k * PERIOD_S) * 1e9) for k in range(FRAMES)]
        self.spent: dict[str, list[float]] = {}
        self.peak_gb: dict[str, float] = {}

    def timed(self, stage: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, whose time and the process's peak memory after it are noted."""

        def run(*arguments: Any) -> Any:
            before = time.process_time()
            result = work(*arguments)
            self.spent.setdefault(stage, []).append(time.process_time() - before)
            self.peak_gb[stage] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
            return result

        return run

    def windows(self, times: list[int]) -> list[np.ndarray]:
        """Bursts of the frames' windows."""
        return [frame_window(self.drive, t_ns, True, self.settings).bursts for t_ns in times]

    def keyframe(self, t_ns: int) -> int:
        """Ordinal of the first front burst that ends after the image."""
        front = self.drive.of(True)
        return int(front[np.searchsorted(self.drive.end_ns[front], t_ns, side="right")])

    def frames(self, times: list[int]) -> None:
        """Make consecutive frames as the stage does: nothing is read yet, and no more kept than it keeps."""
        self.drive.keep(0)
        self.drive.keep(FRAME_POINTS)
        window = StaticWindow(self.drive, self.static, self.camera, self.settings)
        workspace = Workspace()
        open_, sweep = self.timed(READ, window.open), self.timed(READ, self.drive.sweep)
        select = self.timed("windows, MAD, crop", window.select)
        build = self.timed("visibility, raster", frame_stage.build_frame)
        save = self.timed("write", write_arrays)
        seen = self.timed(VISIBILITY, two_pass_visibility)
        for start in progress(range(0, len(times), BLOCK_FRAMES), "blocks of frames"):
            block = times[start : start + BLOCK_FRAMES]
            windows = self.windows(block)
            open_(np.unique(np.concatenate(windows)))
            for t_ns, bursts in zip(block, windows, strict=True):
                pose, key = self.drive.trajectory.at(t_ns), self.keyframe(t_ns)
                chosen = select(bursts, key, pose)
                points = sweep(key).points
                with patch.object(frame_stage, "two_pass_visibility", seen):
                    made = build(chosen, points, pose, self.camera, self.settings, workspace)
                self.counts = made.counts
                save(self.scratch / "frame.npz", {"points": made.points}, "ground_truth_points")

    def a_frame(self, frames: int) -> dict[str, float]:
        """CPU-seconds a frame by stage."""
        return {stage: sum(spent) / frames for stage, spent in self.spent.items()}

    def plain_reading(self) -> float:
        """CPU-seconds a burst from LAZ to world points, as one would first write it."""
        chosen = np.linspace(0, len(self.drive) - 1, PLAIN_BURSTS).astype(int).tolist()
        before = time.process_time()
        for i in chosen:
            las = laspy.read(self.drive.files[i])
            times = int(self.drive.files[i].stem) + np.asarray(las["offset_ns"]).astype(np.int64)
            apply(self.drive.poses(i, times), np.asarray(las.xyz))
        return (time.process_time() - before) / len(chosen)

    def naive(self, t_ns: int) -> tuple[dict[str, float], dict[str, float], float, float]:
        """CPU-seconds of the naive ways by stage, and of visibility alone: Open3D's and ours."""
        reading = self.plain_reading()
        bursts, pose = self.windows([t_ns])[0], self.drive.trajectory.at(t_ns)
        naive, tuned, (cloud, key, D) = naive_frame(
            [self.drive.sweep(int(i)).points for i in bursts],
            self.drive.front[bursts].tolist(),
            self.drive.sweep(self.keyframe(t_ns)).points,
            self.static,
            inverse(pose @ self.camera.rig_from_camera),
            self.camera,
            self.settings,
        )
        anew, once = len(bursts), len(np.unique(np.concatenate(self.windows(self.times)))) / FRAMES
        naive = {f"read {anew} bursts": anew * reading, **naive}
        tuned = {f"read {once:.1f} bursts": once * reading, **tuned}
        nothing, workspace = np.zeros(len(cloud), dtype=np.bool_), Workspace()
        two_pass_visibility(cloud, nothing, key, D, self.settings, workspace)
        before = time.process_time()
        first, second, of_key = two_pass_visibility(cloud, nothing, key, D, self.settings, workspace)
        ours = time.process_time() - before
        both = np.concatenate([cloud[first], key])
        plain = both[visible_by_hull(both, self.settings["hpr_second"] * D)]
        assert set(map(tuple, plain)) == set(map(tuple, np.concatenate([cloud[second], key[of_key]])))
        return naive, tuned, tuned["Open3D"], ours


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows of a frame's CPU time, its ratios to the naive ways, visibility apart, memory over ten minutes."""
    bench = Bench(scratch)
    bench.frames(bench.times[:1])  # compiles
    bench.spent.clear()
    bench.frames(bench.times)
    stages, visible = bench.a_frame(FRAMES), statistics.median(bench.spent[VISIBILITY])
    bench.spent.clear()
    bench.settings["pixels_per_point"] = 0
    bench.frames(bench.times[:FRAMES_ALL_POINTS])
    naive, tuned, plain, ours = bench.naive(bench.times[0])
    all_points = bench.a_frame(FRAMES_ALL_POINTS) | {READ: stages[READ]}
    frame, frame_all_points = _sum(stages), _sum(all_points)
    print("points of the last frame:", *(f"{name[7:]} {count}" for name, count in bench.counts.items()))
    tables = {"ours": stages, "ours, all points": all_points, "naive": naive, "tuned naive": tuned}
    for title, spent in tables.items():
        print(f"\n{title}, CPU-s a frame")
        for stage, seconds in spent.items():
            peak = f"peak {bench.peak_gb[stage]:.2f} GB" if stage in bench.peak_gb else ""
            print(f"  {stage:45}{seconds:9.3f}  {peak}")
    return [
        _row("frame_cpu_s", frame, "CPU-s", 0.6, "lower"),
        _row("frame_all_points_cpu_s", frame_all_points, "CPU-s", None, "lower"),
        _row("naive_ratio", _sum(naive) / frame, "1", 100, "higher"),
        _row("naive_ratio_all_points", _sum(naive) / frame_all_points, "1", None, "higher"),
        _row("tuned_ratio", _sum(tuned) / frame, "1", 25, "higher"),
        _row("tuned_ratio_all_points", _sum(tuned) / frame_all_points, "1", None, "higher"),
        _row("visibility_cpu_s", visible, "CPU-s", 0.35, "lower"),
        _row("visibility_ratio", plain / ours, "1", None, "higher"),
        _row("peak_gb_10min", in_a_process(10)["peak_gb"], "GB", 4, "lower"),
    ]


def _hit_by_both(drive: Drive, settings: dict[str, Any]) -> StaticSet:
    grid = VoxelGrid.around(drive.trajectory, settings["voxel_size_m"])
    sweeps = ((i, bool(drive.front[i]), drive.sweep(i).points) for i in progress(range(len(drive)), "map"))
    voxels = build_voxel_map(sweeps, drive.origins, grid, settings)
    both = np.flatnonzero(voxels.hit_by_both)
    return StaticSet(grid, voxels.keys[both], voxels.counts[both], {})


def _sum(stages: dict[str, float]) -> float:
    """All stages together."""
    return sum(spent for stage, spent in stages.items() if stage != VISIBILITY)


def _row(figure: str, value: float, unit: str, aim: float | None, better: str) -> dict[str, Any]:
    row = {"stage": "ground_truth", "figure": figure, "value": value, "unit": unit}
    return row | {"aim": aim, "better": better}
