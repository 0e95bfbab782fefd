"""Both stages where scans tell little, and led by another LiDAR than the front one."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from both_stages import expected, figures, refined, run
from street_scene import Motion, Street, houses, standing, swaying, trunks, tunnel

from card.artifacts import default_settings, read_json, read_table
from card.poses.map_quality import map_figures


@pytest.mark.parametrize("lidars", [["lidar_rear"], ["lidar_front", "lidar_rear"]])
def test_the_rear_lidar_leads_as_well_alone_or_beside_the_front(tmp_path: Path, lidars: list[str]) -> None:
    both = ("lidar_front", "lidar_rear")
    street = Street(houses(length=40), swaying(6.0, turn=0.1), seconds=2.0, columns=120, lidars=both)
    folder = street.record(tmp_path / "drive")
    report = run(folder, odometry={"lidars": lidars})
    table = read_table(folder / "odometry.parquet", "odometry_states")
    assert set(table["lidar"].to_pylist()) == set(lidars)
    assert table.num_rows == 19 * len(lidars)
    assert np.all(table["registered"].to_numpy(zero_copy_only=False)[1:])
    assert report["counts"]["nodes"] == table.num_rows
    path = refined(folder)
    error = path.translation_m - expected(street, path.t_ns)[:, :3, 3]
    assert np.linalg.norm(error, axis=1).max() < 0.02
    sweeps = read_table(folder / "bursts.parquet", "bursts")
    alone = sweeps.filter(pc.is_in(sweeps["lidar"], value_set=pa.array(lidars)))
    calibration = read_json(folder / "calibration.json", "calibration")
    true = street.truth(np.asarray(read_table(folder / "imu.parquet", "imu")["t_ns"]))
    settings = default_settings("poses") | {"quality_spacing_m": 1.0}
    sharp = {f.name: f.value for f in map_figures(folder, alone, calibration, {}, true, settings)}
    assert 0 < sharp["map_thickness_mm"] < 30


@pytest.mark.parametrize(
    ("name", "boxes", "motion", "weak"),
    [
        ("standing", houses(length=40), standing, False),
        ("tunnel", tunnel(), swaying(6.0), True),
        # Trunks on open ground tell the place across a hundred times less than the height, but tell it.
        ("trunks", trunks(), swaying(6.0), False),
    ],
)
def test_what_scans_leave_open_is_named(
    tmp_path: Path, name: str, boxes: np.ndarray, motion: Motion, weak: bool
) -> None:
    street = Street(boxes, motion, seconds=2.0, columns=240)
    report = run(street.record(tmp_path / name), weak_s=0.5)
    assert (figures(report)["longest_weak_s"] > 1.5) is weak
    assert any("weakly determined" in note for note in report["notes"]) is weak
    path = refined(tmp_path / name)
    error = path.translation_m - expected(street, path.t_ns)[:, :3, 3]
    # Along the tunnel only the IMU leads, from a velocity that nothing tells.
    assert np.abs(error[:, [0, 2]] if weak else error).max() < 0.02
