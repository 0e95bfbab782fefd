"""The compiled map and votes against the plain ones on the demo drives, at the tiny scale."""

import dataclasses

import numpy as np
import pytest

from card.artifacts import default_settings, write_table
from card.ground_truth.reference.visibility_votes import visibility_votes as plain_votes
from card.ground_truth.reference.voxel_map import build_voxel_map as plain_voxel_map
from card.ground_truth.sweeps import Drive
from card.ground_truth.visibility_votes import evidence_sweeps, visibility_votes
from card.ground_truth.voxel_map import VoxelMap, build_voxel_map
from card.ground_truth.voxels import VoxelGrid
from card.recording.laz import read_burst
from card.recording.paths import LIDARS
from card.simulation.calibrations import true_calibration
from card.simulation.drives import DRIVES
from card.simulation.record import write_sweeps
from card.simulation.simulate import write_description, write_motion
from card.simulation.world import build_world

SETTINGS = default_settings("ground_truth")
#: Sweeps whose votes are compared: the plain path takes a second for each.
SWEEPS = 10


def drive_of(name: str, folder) -> Drive:
    world = build_world(name, "tiny", 1)
    recording, truth = folder / "recording", folder / "truth"
    recording.mkdir()
    truth.mkdir()
    path = write_motion(world, recording, truth)
    write_sweeps(world, recording, truth, 1)
    write_description(world, recording, cameras=())
    rows: dict[str, list] = {k: [] for k in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")}
    for lidar in LIDARS:
        for number, file in enumerate(sorted((recording / lidar).glob("*.laz"))):
            burst = read_burst(file)
            values = (lidar, number, burst.t_ns, burst.end_ns, len(burst), f"{lidar}/{file.name}")
            for column, value in zip(rows.values(), values, strict=True):
                column.append(value)
    write_table(folder / "bursts.parquet", rows, "bursts")
    calibration = true_calibration(world.drive.session, 1, "tiny")
    return Drive(recording, folder / "bursts.parquet", calibration, path, SETTINGS)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if number == 0 else [pytest.mark.slow])
        for number, name in enumerate(DRIVES)
    ],
)
def test_compiled_and_plain_agree_on_a_drive(name, tmp_path):
    drive = drive_of(name, tmp_path)
    bursts = [(i, bool(drive.front[i]), drive.sweep(i).points) for i in range(len(drive))]
    grid = VoxelGrid.around(drive.trajectory, 0.1)
    voxels = build_voxel_map(bursts, drive.origins, grid, SETTINGS)
    plain = plain_voxel_map(bursts, drive.origins, grid, SETTINGS)
    for field in dataclasses.fields(VoxelMap):
        if field.name != "grid":
            assert np.array_equal(getattr(voxels, field.name), getattr(plain, field.name)), field.name
    chosen = np.flatnonzero(voxels.hit_by_both)
    every = evidence_sweeps(drive, SETTINGS)
    sweeps = every[:: max(1, len(every) // SWEEPS)]
    votes = visibility_votes(drive, sweeps, voxels, chosen, SETTINGS)
    wanted = plain_votes(drive, sweeps, voxels, chosen, SETTINGS)
    for kind in ("hits", "beside", "moved"):
        assert np.array_equal(getattr(votes, kind), getattr(wanted, kind)), kind
    assert votes.hits.sum() > 1000
    assert votes.beside.sum() > 10
