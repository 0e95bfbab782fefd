"""Quasi-dense ground truth of a sequence: from bursts to clouds (paper, supplement A-E)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import (
    atomic_folder,
    inventory,
    load_schema,
    progress,
    read_json,
    read_table,
    write_arrays,
    write_table,
)
from card.artifacts.processes import in_processes
from card.errors import CardError
from card.geometry import Trajectory
from card.ground_truth.consensus import Consensus, DepthSource, depth_maps
from card.ground_truth.coverage import FrameWindow, frame_window
from card.ground_truth.frame import build_frame
from card.ground_truth.hpr.workspace import Workspace
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.monocular import OnnxDepth
from card.ground_truth.static_set import StaticSet, static_voxels
from card.ground_truth.static_window import StaticWindow
from card.ground_truth.summary import write_summary
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxels import unpack

#: Frames whose bursts are ordered by voxel at once: more take more memory, fewer more time.
BLOCK_FRAMES = 100
#: World points of front bursts that each process keeps meanwhile: one that enters the windows is a keyframe
#: 13 s later, and a block may read ten seconds ahead.
FRAME_POINTS = 12_000_000


def aggregate(
    *,
    recording: Path,
    bursts: Path,
    frames: Path,
    calibration: Path,
    ego_mask: Path,
    trajectory: Path,
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    threads: int,
    anonymized: Path | None = None,
) -> None:
    """Write the folder `out`: a cloud a frame, the static voxels, the coverage and an inventory.

    Parameters
    ----------
    recording : folder with the bursts; bursts, frames : tables of schemas ``bursts`` and ``frames``.
    calibration, ego_mask, trajectory : the session's calibration and mask, poses at IMU rate.
    settings : schema ``settings/ground_truth``, filled. gates : limits for figures of the report.
    threads : processes that work on frames; the bytes do not depend on it.
    anonymized : folder of the anonymized images, for a monocular model (``consensus``).

    Raises
    ------
    CardError
        If the poses do not cover a burst or a frame, a burst comes twice, or the ego mask does not fit.
    """
    document = read_json(calibration, "calibration")
    camera = LeftCamera(document, ego_mask)
    poses = Trajectory.from_table(read_table(trajectory, "trajectory"))
    drive = Drive(recording, bursts, document, poses, settings)
    tasks = _tasks(frames, drive)
    consensus = _consensus(drive.id, camera, anonymized, settings)
    static = static_voxels(drive, settings)
    with atomic_folder(out) as folder:
        work = _Work(drive, static, camera, settings, folder, consensus)
        rows = list(progress(_rows(work, tasks, threads), "frames", total=len(tasks)))
        _write_static(folder / "static_voxels.npz", static)
        columns = {name: [row[name] for row in rows] for name in load_schema("coverage")["columns"]}
        write_table(folder / "coverage.parquet", columns, "coverage")
        write_table(folder / "inventory.parquet", inventory(folder), "inventory")
    inputs = {
        "bursts": bursts,
        "frames": frames,
        "calibration": calibration,
        "ego_mask": ego_mask,
        "trajectory": trajectory,
    }
    write_summary(report, drive.id, static.why, rows, inputs, settings, gates)


@dataclass(frozen=True)
class _Task:
    frame: int
    t_ns: int
    keyframe: int  # ordinal in the drive, -1 for none


@dataclass(frozen=True)
class _Work:
    drive: Drive
    static: StaticSet
    camera: LeftCamera
    settings: Mapping[str, Any]
    folder: Path
    consensus: Consensus | None

    def rows(self, tasks: Sequence[_Task]) -> Iterator[dict[str, Any]]:
        """Write the clouds of consecutive frames; yield their rows of schema ``coverage``."""
        self.drive.keep(FRAME_POINTS)
        workspace = Workspace()
        window = StaticWindow(self.drive, self.static, self.camera, self.settings)
        for start in range(0, len(tasks), BLOCK_FRAMES):
            block = tasks[start : start + BLOCK_FRAMES]
            selected = [
                frame_window(self.drive, task.t_ns, task.keyframe >= 0, self.settings) for task in block
            ]
            window.open(np.unique(np.concatenate([frame.bursts for frame in selected])))
            for task, frame in zip(block, selected, strict=True):
                yield self._row(task, frame, window, workspace)

    def _row(
        self, task: _Task, selected: FrameWindow, window: StaticWindow, workspace: Workspace
    ) -> dict[str, Any]:
        world_from_rig = self.drive.trajectory.at(task.t_ns)
        selection = window.select(selected.bursts, task.keyframe, world_from_rig)
        keyframe = self.drive.sweep(task.keyframe).points if task.keyframe >= 0 else np.empty((0, 3))
        consistent = (
            None if self.consensus is None else partial(self.consensus.consistent, task.frame, task.t_ns)
        )
        frame = build_frame(
            selection, keyframe, world_from_rig, self.camera, self.settings, workspace, consistent
        )
        write_arrays(self.folder / f"{task.frame:06d}.npz", {"points": frame.points}, "ground_truth_points")
        share = frame.pixels / (self.camera.image.width * self.camera.image.height)
        row = {"frame": task.frame, **selected.columns, **frame.counts, "image_share": share}
        return row | {"points_rejected": frame.rejected}


def _consensus(
    sequence: str, camera: LeftCamera, anonymized: Path | None, settings: Mapping[str, Any]
) -> Consensus | None:
    wanted = settings["consensus"]
    if sequence not in wanted["sequences"]:
        return None
    if bool(wanted["depth_maps"]) == bool(wanted["model"]):
        raise CardError(
            "consensus without a depth",
            where=f"ground_truth.consensus, {sequence}",
            wanted="either depth_maps or model",
        )
    if wanted["depth_maps"]:
        source: DepthSource = depth_maps(Path(wanted["depth_maps"]) / sequence, camera.undistorted)
    elif anonymized is None:
        raise CardError("consensus without anonymized images", where=sequence)
    else:
        source = OnnxDepth(anonymized, camera.image, camera.undistorted, wanted)
    return Consensus(source, camera.undistorted, wanted)


def _tasks(frames: Path, drive: Drive) -> list[_Task]:
    table = read_table(frames, "frames")
    front = {int(drive.index[i]): int(i) for i in drive.of(True)}
    tasks = []
    for frame, t_ns, burst in zip(
        *(table[name].to_pylist() for name in ("frame", "t_ns", "lidar_front_burst")), strict=True
    ):
        if not drive.trajectory.start_ns <= t_ns <= drive.trajectory.end_ns:
            raise CardError(
                "poses do not cover the image",
                where=f"{frames}, frame {frame}",
                found=t_ns,
                wanted=f"{drive.trajectory.start_ns}..{drive.trajectory.end_ns} ns",
            )
        if burst is not None and burst not in front:
            raise CardError(
                "frame names a burst that is not there", where=f"{frames}, frame {frame}", found=burst
            )
        tasks.append(_Task(frame, t_ns, -1 if burst is None else front[burst]))
    return tasks


def _rows(work: _Work, tasks: list[_Task], threads: int) -> Iterator[dict[str, Any]]:
    # Consecutive frames share most of their bursts, so each process takes one run of them.
    runs = [tasks[at[0] : at[-1] + 1] for at in np.array_split(np.arange(len(tasks)), threads) if len(at)]
    if len(runs) == 1:
        yield from work.rows(tasks)
        return
    for rows in in_processes(lambda run: list(work.rows(run)), runs, threads):
        yield from rows


def _write_static(path: Path, static: StaticSet) -> None:
    write_arrays(
        path,
        {
            "origin": static.grid.origin,
            "voxel_size": np.float64(static.grid.size),
            "ids": unpack(static.keys).astype(np.int32),
            "counts": static.counts,
        },
        "static_voxels",
    )
