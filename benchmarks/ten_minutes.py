"""Ten minutes of driving, made of a simulated drive that goes on again where it ended."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ground_truth_figures import Inputs
from numpy.typing import NDArray

from card.artifacts import read_arrays, read_table, write_arrays, write_table
from card.geometry import Trajectory, apply, quaternion_from_matrix, transform

Array = NDArray[np.float64]
ROUNDS, ROUND_NS = 15, 40_000_000_000


@dataclass(frozen=True)
class Long:
    """The folder and tables of a long drive, as the wheels stage reads them."""

    folder: Path

    @property
    def bursts(self) -> Path:
        return self.folder / "bursts.parquet"

    @property
    def frames(self) -> Path:
        return self.folder / "frames.parquet"

    @property
    def trajectory(self) -> Path:
        return self.folder / "trajectory.parquet"

    @property
    def static_voxels(self) -> Path:
        return self.folder / "static_voxels.npz"


def ten_minutes(inputs: Inputs, static_voxels: Path, folder: Path) -> Long:
    """The first `ROUND_NS` of a drive, `ROUNDS` times.

    Each round starts where the one before ended, turned about z only; its sweeps are the same files under
    later times.
    """
    long = Long(folder)
    for lidar in ("lidar_front", "lidar_rear"):
        (folder / lidar).mkdir(parents=True)
    shutil.copy(inputs.recording / "recording.yaml", folder)
    drive = Trajectory.from_table(read_table(inputs.trajectory, "trajectory"))
    rounds = _rounds(drive)
    _write_trajectory(long, drive, rounds)
    _write_bursts(long, inputs, drive.start_ns)
    _write_frames(long, drive.start_ns)
    _write_static(long, static_voxels, rounds)
    return long


def _rounds(drive: Trajectory) -> list[Array]:
    """world_from_drive (4, 4) of each round."""
    first, last = drive.at([drive.start_ns, drive.start_ns + ROUND_NS])
    forward = (last[:3, :3] @ first[:3, :3].T)[:2, 1]
    turn = np.arctan2(-forward[0], forward[1])
    onward = transform(np.zeros(3), [np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)])
    onward[:3, 3] = last[:3, 3] - onward[:3, :3] @ first[:3, 3]
    found = [np.eye(4)]
    while len(found) < ROUNDS:
        found.append(found[-1] @ onward)
    return found


def _write_trajectory(long: Long, drive: Trajectory, rounds: list[Array]) -> None:
    once = drive.t_ns[drive.t_ns < drive.start_ns + ROUND_NS]
    t_ns = np.concatenate([once + k * ROUND_NS for k in range(ROUNDS)])
    poses = np.concatenate([world_from_drive @ drive.at(once) for world_from_drive in rounds])
    path = Trajectory(t_ns, poses[:, :3, 3], quaternion_from_matrix(poses[:, :3, :3]))
    write_table(long.trajectory, path.to_table(), "trajectory")


def _write_bursts(long: Long, inputs: Inputs, start_ns: int) -> None:
    table = read_table(inputs.bursts, "bursts")
    # The last sweep of a round has no poses to its end.
    last = start_ns + ROUND_NS - 10_000_000
    rows = [row for row in table.to_pylist() if row["t_end_ns"] < last]
    written = []
    for k in range(ROUNDS):
        for row in rows:
            start = row["t_start_ns"] + k * ROUND_NS
            file = f"{row['lidar']}/{start}.laz"
            (long.folder / file).symlink_to((inputs.recording / row["file"]).resolve())
            times = {"t_start_ns": start, "t_end_ns": row["t_end_ns"] + k * ROUND_NS}
            number = row["burst"] + k * len(table)
            written.append({**row, **times, "burst": number, "file": file})
    columns = {name: [row[name] for row in written] for name in table.column_names}
    write_table(long.bursts, columns, "bursts")


def _write_frames(long: Long, start_ns: int) -> None:
    times = start_ns + np.arange(100_000_000, ROUNDS * ROUND_NS - ROUND_NS // 100, 100_000_000)
    nothing = dict.fromkeys(
        ("right_file", "right_t_ns", "lidar_front_burst", "lidar_rear_burst"), [None] * len(times)
    )
    files = [f"camera_left/{t}.jpg" for t in times]
    columns = {"frame": np.arange(len(times), dtype=np.int32), "t_ns": times, "left_file": files}
    write_table(long.frames, {**columns, **nothing}, "frames")


def _write_static(long: Long, static_voxels: Path, rounds: list[Array]) -> None:
    arrays = read_arrays(static_voxels, "static_voxels")
    size, origin = float(arrays["voxel_size"]), np.asarray(arrays["origin"])
    centres = origin + (arrays["ids"] + 0.5) * size
    moved = [np.floor((apply(world_from_drive, centres) - origin) / size) for world_from_drive in rounds]
    ids, counts = np.unique(np.concatenate(moved).astype(np.int32), axis=0, return_counts=True)
    write_arrays(
        long.static_voxels, {**arrays, "ids": ids, "counts": counts.astype(np.int32)}, "static_voxels"
    )
