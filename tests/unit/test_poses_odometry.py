"""Stage 1 on a street of boxes: accurate, repeatable, and wary of what a recording can have wrong."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_scene import START_NS, Street, houses, standing, swaying, tunnel

from card.artifacts import default_settings, read_json, read_table, write_json, write_table
from card.errors import CardError
from card.estimation.odometry import rehearsed
from card.estimation.scans import Scans
from card.estimation.smoother import State
from card.geometry import Trajectory, inverse
from card.poses.estimate_odometry import estimate_odometry
from card.poses.inputs import open_imu
from card.recording.laz import read_burst, write_burst


def run(folder: Path, **changes: Any) -> tuple[Any, dict[str, Any]]:
    estimate_odometry(
        recording=folder,
        calibration=folder / "calibration.json",
        bursts=folder / "bursts.parquet",
        odometry=folder / "odometry.parquet",
        report=folder / "odometry.report.json",
        settings=default_settings("odometry") | changes,
        gates=[],
    )
    report = read_json(folder / "odometry.report.json", "report")
    return read_table(folder / "odometry.parquet", "odometry_states"), report


#: How far the estimate of the offset of clocks may lie off, ms.
CLOCK_MS = 5.0


def figures(report: dict[str, Any]) -> dict[str, float]:
    return {figure["name"]: figure["value"] for figure in report["figures"]}


def drift(table: Any, street: Street) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the way since the first sweep (N, 3) in its rig, m, and rotation errors (N,), rad."""
    t_ns = np.asarray(table["t_ns"])
    found, true = Trajectory.from_table(table).at(t_ns), street.poses(t_ns)
    error = inverse(inverse(true[0]) @ true) @ (inverse(found[0]) @ found)
    angle = np.arccos(np.clip((np.trace(error[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))
    return error[:, :3, 3], angle


@pytest.fixture(scope="module")
def street() -> Street:
    return Street(houses(length=60), swaying(6.0, turn=0.12), seconds=3.0)


@pytest.fixture(scope="module")
def folder(street: Street, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return street.record(tmp_path_factory.mktemp("street") / "drive")


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    """The drive, to be spoilt: its sweeps are links."""
    (tmp_path / "lidar_front").mkdir()
    for path in folder.iterdir():
        if path.is_file() and not path.name.startswith("odometry"):
            (tmp_path / path.name).write_bytes(path.read_bytes())
    for path in (folder / "lidar_front").iterdir():
        (tmp_path / "lidar_front" / path.name).symlink_to(path)
    return tmp_path


def test_a_drive_that_starts_in_motion_is_followed_to_millimetres(street: Street, folder: Path) -> None:
    table, report = run(folder)
    assert table.num_rows == 29
    way, angle = drift(table, street)
    assert np.abs(way).max() < 0.01
    assert np.degrees(angle.max()) < 0.05
    values = figures(report)
    assert values["registered_pct"] == 100
    assert abs(values["clock_offset_ms"]) < CLOCK_MS
    assert values["length_m"] == pytest.approx(6.0 * 2.8, rel=0.01)
    last = {name: table[name][-1].as_py() for name in table.column_names}
    assert np.hypot(last["vx"], last["vy"]) == pytest.approx(6.0, abs=0.02)
    np.testing.assert_allclose([last[f"gyro_bias_{a}"] for a in "xyz"], street.gyro_bias, atol=3e-4)
    assert report["notes"] == []


def test_the_calibration_corrects_the_imu(street: Street, copy: Path) -> None:
    calibration = read_json(copy / "calibration.json", "calibration")
    del calibration["imu_corrections"]
    write_json(copy / "calibration.json", calibration, "calibration")
    table, _ = run(copy)
    last = np.array([table[f"gyro_bias_{axis}"][-1].as_py() for axis in "xyz"])
    # A scale of 1.5 % less of a turn, and as much of gravity, is taken for biases.
    assert np.abs(last - street.gyro_bias).max() > 1e-3


def test_a_start_that_scans_alone_tell_poorly_is_mended_by_a_rehearsal(street: Street, folder: Path) -> None:
    settings = default_settings("odometry")
    scans = _scans(folder, read_table(folder / "bursts.parquet", "bursts"))
    opening = [scans[i] for i in range(20)]
    t_ns = opening[0].end_ns
    before, pose, after = street.poses(np.array([t_ns - 1_000_000, t_ns, t_ns + 1_000_000]))
    velocity = pose[:3, :3].T @ (after - before)[:3, 3] / 2e-3
    up = pose[2, :3]
    wrong = Rotation.from_rotvec([0.06, -0.08, 0.0]).apply(-9.81 * up)
    slow = velocity - np.array([0.3, 0.5, 0.1])
    start = State(t_ns, np.eye(4), slow, np.zeros(3), np.zeros(3), wrong)
    imu = open_imu(folder, folder / "calibration.json")
    found = rehearsed(opening, start, imu, settings)
    assert found.t_ns == t_ns
    assert np.linalg.norm(found.velocity - velocity) < 0.2 * np.linalg.norm(slow - velocity)
    assert np.linalg.norm(found.gravity + 9.81 * up) < 0.2 * np.linalg.norm(wrong + 9.81 * up)


def test_the_same_drive_gives_the_same_bytes(folder: Path) -> None:
    if not (folder / "odometry.parquet").exists():
        run(folder)
    before = (folder / "odometry.parquet").read_bytes()
    run(folder)
    assert (folder / "odometry.parquet").read_bytes() == before


def test_a_standing_car_stays_where_it_is(tmp_path: Path) -> None:
    street = Street(houses(), standing, seconds=2.0)
    table, report = run(street.record(tmp_path / "drive"))
    way, angle = drift(table, street)
    assert np.abs(way).max() < 0.005
    assert angle.max() < 1e-3
    assert figures(report)["clock_offset_ms"] is None
    assert report["notes"] == ["the car turns too little to compare the clocks and axes of LiDAR and IMU"]


def test_in_a_tunnel_without_features_the_scans_say_nothing_of_the_way_along(tmp_path: Path) -> None:
    street = Street(tunnel(), swaying(0.0), seconds=2.0)
    table, _ = run(street.record(tmp_path / "drive"))
    way, _ = drift(table, street)
    assert np.abs(way[:, [0, 2]]).max() < 0.01
    along, across = (np.asarray(table[f"information_{i}{i}"])[1:].mean() for i in (4, 3))
    assert along < 0.01 * across


def spoil_imu(folder: Path, change: Any) -> None:
    table = read_table(folder / "imu.parquet", "imu")
    columns = change({name: np.array(table[name]) for name in table.column_names})
    write_table(folder / "imu.parquet", columns, "imu")


def scaled(columns: dict[str, np.ndarray], kind: str, factor: float) -> dict[str, np.ndarray]:
    return {name: values * factor if name.startswith(kind) else values for name, values in columns.items()}


def test_an_accelerometer_in_g_is_refused(copy: Path) -> None:
    spoil_imu(copy, lambda columns: scaled(columns, "accel", 1 / 9.80665))
    with pytest.raises(
        CardError, match=r"imu.parquet: specific force is (0.99|1.00). in the median: .* in g"
    ):
        run(copy)
    assert not (copy / "odometry.parquet").exists()


def test_a_gyro_in_degrees_is_refused(copy: Path) -> None:
    spoil_imu(copy, lambda columns: scaled(columns, "gyro", 180 / np.pi))
    with pytest.raises(CardError, match=r"different motions .*gyro agrees .* deg/s with axes \(x, y, z\)"):
        run(copy)


def test_gravity_along_another_axis_is_refused(copy: Path) -> None:
    def turned(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return columns | {"accel_x": columns["accel_z"], "accel_z": columns["accel_x"]}

    spoil_imu(copy, turned)
    with pytest.raises(CardError, match=r"axes of the accelerometer are swapped .*along x, wanted z"):
        run(copy)


def test_swapped_level_axes_are_refused(copy: Path) -> None:
    def turned(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        for kind in ("gyro", "accel"):
            x, y = columns[f"{kind}_x"], columns[f"{kind}_y"]
            columns[f"{kind}_x"], columns[f"{kind}_y"] = y, -x
        return columns

    spoil_imu(copy, turned)
    with pytest.raises(CardError, match=r"rad/s with axes \(-y, x, z\)"):
        run(copy)


def test_a_gap_of_two_seconds_is_named(copy: Path) -> None:
    spoil_imu(copy, lambda columns: {name: np.delete(v, slice(100, 500)) for name, v in columns.items()})
    with pytest.raises(CardError, match=rf"after {START_NS + 495_000_000} ns: gap in the IMU \(found 2.0"):
        run(copy)


def test_clocks_that_differ_are_measured_and_refused(folder: Path, copy: Path) -> None:
    if not (folder / "odometry.report.json").exists():
        run(folder)
    without = figures(read_json(folder / "odometry.report.json", "report"))["clock_offset_ms"]
    spoil_imu(copy, lambda columns: columns | {"t_ns": columns["t_ns"] + 50_000_000})
    with pytest.raises(CardError, match="clocks of LiDAR and IMU differ") as refused:
        run(copy)
    measured = re.search(r"IMU's is (\S+) ms ahead", str(refused.value))
    assert measured is not None
    assert float(measured[1]) == pytest.approx(50, abs=CLOCK_MS)
    assert float(measured[1]) - without == pytest.approx(50, abs=2)


def test_an_offset_that_explains_nothing_is_not_believed(
    folder: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("card.estimation.scan_checks.clock_offset", lambda imu, windows: (-0.276, 1e-4))
    _, report = run(copy)
    assert figures(report)["clock_offset_ms"] is None
    assert figures(report)["scan_gyro_error_deg"] < 0.5
    assert any("too poor" in note for note in report["notes"])


def test_a_sweep_without_times_is_refused_unless_it_is_deskewed(copy: Path) -> None:
    path = sorted((copy / "lidar_front").iterdir())[2]
    burst = read_burst(path)
    path.unlink()
    object.__setattr__(burst, "offset_ns", np.zeros_like(burst.offset_ns))
    write_burst(path, burst)
    with pytest.raises(CardError, match=rf"{path.name}: sweep without a time for each point"):
        run(copy)


def test_too_few_sweeps_are_refused(copy: Path) -> None:
    spoil_imu(copy, lambda columns: {name: values[:30] for name, values in columns.items()})
    with pytest.raises(CardError, match=r"IMU covers too few sweeps \(found 1 within"):
        run(copy, check_s=0.01)


def test_the_next_sweep_is_read_while_one_is_used(folder: Path) -> None:
    table = read_table(folder / "bursts.parquet", "bursts")
    assert [i for i, _ in _scans(folder, table).ahead([3, 1, 2])] == [3, 1, 2]


def _scans(folder: Path, table: Any) -> Scans:
    from card.estimation.scans import Limits

    calibration = read_json(folder / "calibration.json", "calibration")
    return Scans(folder, table, calibration, {}, ["lidar_front"], Limits(1.0, 100.0, (-180, 180)))
