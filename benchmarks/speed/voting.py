"""The static grid and the moved votes at the size of a real drive, and how both grow with its length."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cost import cpu_s
from field import field_drive
from field_ground_truth import inputs_of
from numpy.typing import NDArray
from own_process import alone

from card.artifacts import default_settings
from card.geometry import Trajectory
from card.ground_truth.reference.voxel_map import build_voxel_map as plain_voxel_map
from card.ground_truth.visibility_votes import evidence_sweeps, visibility_votes
from card.ground_truth.voxel_map import VoxelMap, build_voxel_map
from card.ground_truth.voxels import VoxelGrid

DRIVE, SEED, SECONDS = "de_town_bumps", 1, 10.0
SETTINGS = default_settings("ground_truth")
#: Copies of the drive, one behind the other, that make 1, 3 and 10 minutes.
MINUTES = {1: 6, 3: 18, 10: 60}
Burst = tuple[int, bool, NDArray[np.float64]]


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """CPU time of both, without reading; of the grid over copies of the drive, and its peak memory."""
    drive = inputs_of(field_drive(DRIVE, SEED, SECONDS, scratch)).drive(SETTINGS)
    bursts = [(i, bool(drive.front[i]), drive.sweep(i).points) for i in range(len(drive))]
    grid = VoxelGrid.around(drive.trajectory, SETTINGS["voxel_size_m"])
    voxels = build_voxel_map(bursts, drive.origins, grid, SETTINGS)
    chosen = np.flatnonzero(voxels.hit_by_both)
    sweeps = evidence_sweeps(drive, SETTINGS)

    def votes() -> None:
        visibility_votes(drive, sweeps, voxels, chosen, SETTINGS)

    votes()
    fast = cpu_s(lambda: build_voxel_map(bursts, drive.origins, grid, SETTINGS), repeats)
    plain = cpu_s(lambda: plain_voxel_map(bursts, drive.origins, grid, SETTINGS), 1)
    found = [
        _row("grid_ms_per_burst", 1e3 * fast / len(bursts), "ms", 10),
        _row("grid_plain_ratio", plain / fast, "1", None, "higher"),
        _row("votes_ms_per_scan", 1e3 * cpu_s(votes, repeats) / len(sweeps), "ms", 60),
    ]
    for minutes, copies in MINUTES.items():
        # A process of its own: its peak memory is that of this grid.
        seconds, spent = alone(_long, bursts, drive.origins, drive.trajectory, copies)
        per_burst = 1e3 * seconds / (len(bursts) * copies)
        found.append(_row(f"grid_ms_per_burst_{minutes}min", per_burst, "ms", 10))
    return [*found, _row("grid_peak_gb_10min", spent.peak_gb, "GB", 4)]


def _long(
    bursts: Sequence[Burst], origins: NDArray[np.float64], trajectory: Trajectory, copies: int
) -> float:
    """CPU-seconds of the grid over copies of a drive."""
    step = np.array([0.0, np.ptp(trajectory.translation_m[:, 1]) + 1.0, 0.0])
    grid = VoxelGrid.around(trajectory, SETTINGS["voxel_size_m"])
    every = np.concatenate([origins + k * step for k in range(copies)])

    def copied() -> Iterator[Burst]:
        for k in range(copies):
            for i, front, points in bursts:
                yield i + k * len(bursts), front, points + k * step

    def build() -> VoxelMap:
        return build_voxel_map(copied(), every, grid, SETTINGS)

    return cpu_s(build, 1)


def _row(figure: str, value: float, unit: str, aim: float | None, better: str = "lower") -> dict[str, Any]:
    return {
        "stage": "ground_truth",
        "figure": figure,
        "value": value,
        "unit": unit,
        "aim": aim,
        "better": better,
    }
