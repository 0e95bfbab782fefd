"""Import mode of the poses on a synthetic drive whose true motion and IMU are known in closed form."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from card.artifacts import default_settings, read_json, read_table, write_json, write_table
from card.errors import CardError
from card.geometry import Trajectory, from_json, transform
from card.poses import import_trajectory
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.simulation.calibrations import true_calibration

START_NS = 1_776_153_600_000_000_000
SECONDS = 8.0
SPEED = 6.0
GRAVITY = np.array([0, 0, 9.80665])
WXYZ = [3, 0, 1, 2]


def motion(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """A bend at constant speed with a swaying body: positions and world_from_rig of t seconds."""
    yaw = 0.25 * t
    radius = SPEED / 0.25
    position = np.stack([radius * (np.cos(yaw) - 1), radius * np.sin(yaw), 0.02 * np.sin(4 * t)], axis=1)
    body = np.stack([yaw, 0.02 * np.sin(3 * t), 0.03 * np.sin(2 * t)], axis=1)
    return position, Rotation.from_euler("ZXY", body)


def imu_columns(t: np.ndarray) -> dict[str, np.ndarray]:
    """What an ideal IMU measures, by central differences."""
    step = 1e-4
    (before, r0), (now, r), (after, r1) = motion(t - step), motion(t), motion(t + step)
    gyro = (r0.inv() * r1).as_rotvec() / (2 * step)
    accel = r.inv().apply((after - 2 * now + before) / step**2 + GRAVITY)
    columns = {"t_ns": START_NS + np.round(t * 1e9).astype(np.int64)}
    for i, axis in enumerate("xyz"):
        columns |= {f"gyro_{axis}": gyro[:, i], f"accel_{axis}": accel[:, i]}
    return columns


def tum(t: np.ndarray, position: np.ndarray, rotation: Rotation) -> str:
    rows = zip(t, position, rotation.as_quat(), strict=True)
    return "".join(
        f"{START_NS // 10**9}.{round(stamp * 1e9):09d} " + " ".join(f"{v:.9f}" for v in (*p, *q)) + "\n"
        if stamp < 1
        else f"{START_NS / 1e9 + stamp:.6f} " + " ".join(f"{v:.9f}" for v in (*p, *q)) + "\n"
        for stamp, p, q in rows
    )


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """A folder as the stage finds it: recording, trajectory at 50 Hz, IMU at 200 Hz, tables, calibration."""
    sensors = {
        "lidar_front": {"model": "XT32", "clock": "synchronised", "deskewed": False},
        "imu": {"model": "IMU", "clock": "synchronised"},
    }
    description = {"id": "drive", "rig": "r", "day": "2026-04-14", "place": "p", "country": "DE"}
    (tmp_path / "recording.yaml").write_text(yaml.safe_dump(description | {"sensors": sensors}))
    t = np.arange(0, SECONDS, 0.02)
    (tmp_path / "trajectory.tum").write_text(tum(t, *motion(t)))
    write_table(tmp_path / "imu.parquet", imu_columns(np.arange(-0.5, SECONDS + 0.5, 0.005)), "imu")
    write_json(tmp_path / "calibration.json", true_calibration("2026-04-14-start", 1, "tiny"), "calibration")
    starts = START_NS + np.arange(5, 70) * 100_000_000
    count = len(starts)
    bursts = {
        "lidar": ["lidar_front"] * count,
        "burst": np.arange(count),
        "t_start_ns": starts,
        "t_end_ns": starts + 99_000_000,
        "points": np.full(count, 10),
        "file": [f"lidar_front/{t_ns}.laz" for t_ns in starts],
    }
    write_table(tmp_path / "bursts.parquet", bursts, "bursts")
    (tmp_path / "lidar_front").mkdir()
    points, ring = np.full((10, 3), 5.0), np.zeros(10, np.uint8)
    for t_ns in starts:
        burst = Burst(int(t_ns), points, ring, ring, np.arange(10, dtype=np.uint32) * 11_000_000)
        write_burst(tmp_path / "lidar_front" / f"{t_ns}.laz", burst)
    write_frames(tmp_path, START_NS + np.arange(20, 30) * 100_000_000 + 7)
    return tmp_path


def write_frames(folder: Path, t_ns: np.ndarray) -> None:
    count = len(t_ns)
    frames = {
        "frame": np.arange(count),
        "t_ns": t_ns,
        "left_file": [f"camera_left/{t}.jpg" for t in t_ns],
        "right_file": [f"camera_right/{t}.jpg" if i else None for i, t in enumerate(t_ns)],
        "right_t_ns": [int(t) + 200_000 if i else None for i, t in enumerate(t_ns)],
        "lidar_front_burst": [None] * count,
        "lidar_rear_burst": [None] * count,
    }
    write_table(folder / "frames.parquet", frames, "frames")


def run(folder: Path, **changes: Any) -> tuple[Trajectory, list[dict[str, Any]], dict[str, Any]]:
    import_trajectory(
        delivered=folder / "trajectory.tum",
        recording=folder,
        calibration=folder / "calibration.json",
        bursts=folder / "bursts.parquet",
        frames=folder / "frames.parquet",
        trajectory=folder / "trajectory.parquet",
        poses=folder / "poses.json",
        report=folder / "poses.report.json",
        settings=default_settings("poses") | {"mode": "import", "quality_spacing_m": 20.0} | changes,
        gates=[],
    )
    return (
        Trajectory.from_table(read_table(folder / "trajectory.parquet", "trajectory")),
        read_json(folder / "poses.json", "poses")["poses"],
        read_json(folder / "poses.report.json", "report"),
    )


def figures(report: dict[str, Any]) -> dict[str, float]:
    return {figure["name"]: figure["value"] for figure in report["figures"]}


def expected(t_ns: np.ndarray) -> np.ndarray:
    """True world_from_rig (N, 4, 4): at t = 0 the synthetic motion already is at the origin, facing +y."""
    position, rotation = motion((t_ns - START_NS) / 1e9)
    return transform(position, rotation.as_quat()[:, WXYZ])


def test_trajectory_comes_at_imu_rate_in_world(drive: Path) -> None:
    path, _, report = run(drive)
    t = np.arange(0, SECONDS - 0.02 + 1e-9, 0.005)
    np.testing.assert_array_equal(path.t_ns, START_NS + np.round(t * 1e9).astype(np.int64))
    np.testing.assert_allclose(path.translation_m, expected(path.t_ns)[:, :3, 3], atol=2e-4)
    values = figures(report)
    assert values["delivered_rate_hz"] == pytest.approx(50, rel=1e-3)
    assert values["max_speed_m_s"] == pytest.approx(SPEED, rel=0.01)
    assert values["gyro_rotation_error_deg"] < 0.01
    assert values["gravity_error_deg"] < 0.1
    assert values["gravity_magnitude_error_m_s2"] < 0.02
    assert report["notes"] == []
    assert report["sequence"] == "drive"


def test_every_burst_end_and_image_has_its_pose(drive: Path) -> None:
    _, rows, _ = run(drive)
    kinds = [(row["kind"], row["sensor"]) for row in rows]
    assert kinds.count(("burst_end", "lidar_front")) == 65
    assert kinds.count(("image", "camera_left")) == 10
    assert kinds.count(("image", "camera_right")) == 9
    assert [row["t_ns"] for row in rows] == sorted(row["t_ns"] for row in rows)
    first = rows[0]
    assert (first["index"], first["t_ns"]) == (0, START_NS + 599_000_000)
    np.testing.assert_allclose(from_json(first), expected(np.array([first["t_ns"]]))[0], rtol=0, atol=2e-4)


@pytest.mark.parametrize("frame", ["lidar_rear", "camera_left"])
def test_any_frame_of_the_rig_gives_the_same_poses(drive: Path, frame: str) -> None:
    straight, _, _ = run(drive)
    rig_from_sensor = from_json(
        read_json(drive / "calibration.json", "calibration")["extrinsics"][f"rig_from_{frame}"]
    )
    t = np.arange(0, SECONDS, 0.02)
    position, rotation = motion(t)
    poses = transform(position, rotation.as_quat()[:, WXYZ]) @ rig_from_sensor
    # Another world, too: turned and moved.
    poses = transform([5, -3, 2], [np.cos(0.4), 0, 0, np.sin(0.4)]) @ poses
    (drive / "trajectory.tum").write_text(tum(t, poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3])))
    path, _, _ = run(drive, frame=frame)
    np.testing.assert_allclose(path.translation_m, straight.translation_m, atol=1e-6)


def test_a_kitti_trajectory_in_its_camera_world_gives_the_same_poses(drive: Path) -> None:
    straight, _, _ = run(drive)
    t = np.arange(0, SECONDS, 0.02)
    position, rotation = motion(t)
    poses = transform(position, rotation.as_quat()[:, WXYZ])
    to_camera_world = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    rows = (to_camera_world @ poses)[:, :3].reshape(-1, 12)
    (drive / "trajectory.tum").write_text("\n".join(" ".join(f"{v:.12f}" for v in row) for row in rows))
    (drive / "times.txt").write_text("\n".join(f"{START_NS // 10**9 + s:.6f}" for s in t))
    path, _, _ = run(drive, format="kitti", up_axis="-y")
    np.testing.assert_allclose(path.translation_m, straight.translation_m, atol=1e-6)
    with pytest.raises(CardError, match=r"rig is not upright: wrong frame or up axis.*median tilt 90 deg"):
        run(drive, format="kitti")


def test_quaternions_stored_w_first_are_named(drive: Path) -> None:
    lines = [line.split() for line in (drive / "trajectory.tum").read_text().splitlines()]
    (drive / "trajectory.tum").write_text("\n".join(" ".join([*c[:4], c[7], *c[4:7]]) for c in lines))
    with pytest.raises(CardError, match=r"quaternions are stored w first.*wanted qx qy qz qw"):
        run(drive)


def edit(drive: Path, change: Any) -> None:
    rows = [line.split() for line in (drive / "trajectory.tum").read_text().splitlines()]
    (drive / "trajectory.tum").write_text("\n".join(" ".join(row) for row in change(rows)))


def test_a_gap_is_named(drive: Path) -> None:
    edit(drive, lambda rows: rows[:100] + rows[120:])
    with pytest.raises(
        CardError, match=r"after 1776153601980000000 ns: gap in the trajectory \(found 0.42 s"
    ):
        run(drive)


def test_a_jump_is_named(drive: Path) -> None:
    edit(
        drive, lambda rows: [[*r[:3], str(float(r[3]) + 0.8 * (i > 200)), *r[4:]] for i, r in enumerate(rows)]
    )
    with pytest.raises(CardError, match=r"after 1776153604000000000 ns: trajectory jumps \(found 0.8 m"):
        run(drive)


def test_a_trajectory_in_centimetres_is_too_fast(drive: Path) -> None:
    edit(drive, lambda rows: [[r[0], *(str(100 * float(v)) for v in r[1:4]), *r[4:]] for r in rows])
    with pytest.raises(CardError, match=r"impossible speed \(unit of length or time\?\)"):
        run(drive, max_jump_m=50.0)


def test_what_is_not_covered_is_listed(drive: Path) -> None:
    edit(drive, lambda rows: rows[35:125])
    with pytest.raises(
        CardError, match=r"does not cover.*lidar_front 0-1, 19-64, camera_left 5-9, camera_right 5-9"
    ):
        run(drive)


def spoil_imu(drive: Path, change: Any) -> None:
    table = read_table(drive / "imu.parquet", "imu")
    write_table(
        drive / "imu.parquet", change({name: np.asarray(table[name]) for name in table.column_names}), "imu"
    )


def scaled(columns: dict[str, np.ndarray], kind: str, factor: float) -> dict[str, np.ndarray]:
    return {name: factor * values if name.startswith(kind) else values for name, values in columns.items()}


def test_a_gyro_in_degrees_is_named(drive: Path) -> None:
    spoil_imu(drive, lambda columns: scaled(columns, "gyro", 180 / np.pi))
    _, _, report = run(drive)
    assert figures(report)["gyro_rotation_error_deg"] > 100
    assert report["notes"] == ["gyro agrees with the trajectory if read as deg/s with axes (x, y, z)"]


def test_an_accelerometer_in_g_is_named(drive: Path) -> None:
    spoil_imu(drive, lambda columns: scaled(columns, "accel", 1 / 9.80665))
    _, _, report = run(drive)
    assert figures(report)["gravity_magnitude_error_m_s2"] > 8
    assert any("in g" in note for note in report["notes"])


def test_swapped_axes_are_named(drive: Path) -> None:
    def swap(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        # Mounted forward-left-up instead of right-forward-up.
        for kind in ("gyro", "accel"):
            x, y = columns[f"{kind}_x"], columns[f"{kind}_y"]
            columns[f"{kind}_x"], columns[f"{kind}_y"] = y, -x
        return columns

    spoil_imu(drive, swap)
    _, _, report = run(drive)
    assert report["notes"] == [
        "gyro agrees with the trajectory if read as rad/s with axes (-y, x, z)",
        "accelerometer agrees with the trajectory if read with axes (-y, x, z)",
    ]


def test_a_trajectory_whose_up_is_not_gravity_shows(drive: Path) -> None:
    t = np.arange(0, SECONDS, 0.02)
    position, rotation = motion(t)
    lean = Rotation.from_euler("x", 3, degrees=True)
    (drive / "trajectory.tum").write_text(tum(t, lean.apply(position), lean * rotation))
    _, _, report = run(drive)
    assert figures(report)["gravity_error_deg"] == pytest.approx(3, abs=0.1)


def test_an_imu_of_another_time_is_refused(drive: Path) -> None:
    spoil_imu(drive, lambda columns: columns | {"t_ns": columns["t_ns"] + 3600 * 10**9})
    with pytest.raises(CardError, match=r"IMU and trajectory do not overlap"):
        run(drive)


def test_delivered_poses_fill_a_gap_of_the_imu(drive: Path) -> None:
    def cut(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        seconds = (columns["t_ns"] - START_NS) / 1e9
        keep = (seconds < 3) | (seconds > 4)
        return {name: values[keep] for name, values in columns.items()}

    spoil_imu(drive, cut)
    path, _, _ = run(drive)
    assert np.diff(path.t_ns).max() == 20_000_000


def test_without_imu_the_delivered_times_stay(drive: Path) -> None:
    (drive / "imu.parquet").unlink()
    path, _, report = run(drive)
    assert len(path.t_ns) == report["counts"]["delivered_poses"] == 400
    assert "no IMU" in report["notes"][0]


def test_same_input_same_bytes(drive: Path) -> None:
    run(drive)
    names = ("trajectory.parquet", "poses.json", "poses.report.json")
    first = [(drive / name).read_bytes() for name in names]
    run(drive)
    assert [(drive / name).read_bytes() for name in names] == first
    assert json.loads(first[1])["schema"] == "poses"
