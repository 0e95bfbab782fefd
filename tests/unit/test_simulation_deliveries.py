"""What the team delivers of a drive comes back as the truth, up to what was said to be lost."""

from pathlib import Path

import numpy as np
import pytest

from card.artifacts import default_settings, read_table, write_table
from card.geometry import Trajectory, apply, inverse, quaternion_from_matrix, transform
from card.poses.delivered import read_tum
from card.recording.bag.import_bag import import_bag
from card.recording.burst import Burst
from card.recording.description import read_description, write_description
from card.recording.laz import read_burst, write_burst
from card.recording.paths import CAMERAS, LIDARS, burst_path, image_path, list_bursts, list_images
from card.simulation import deliveries
from card.simulation.board_scene import surroundings
from card.simulation.board_sweep import sweep
from card.simulation.calibrations import session_rig

START_NS = 1_776_153_600_000_000_000
TURNS = 5


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording in the raw layout: a standing car with two LiDARs, two cameras and an IMU."""
    root = tmp_path_factory.mktemp("native")
    rng = np.random.default_rng(0)
    rig, scene = session_rig("2026-04-14-end", 0, "tiny"), surroundings(rng)
    for lidar, phase_ns in zip(LIDARS, (13_000_000, 59_000_000), strict=True):
        (root / lidar).mkdir()
        for number in range(TURNS):
            t_ns = START_NS + phase_ns + number * 100_000_000
            write_burst(burst_path(root, lidar, t_ns), sweep(rig, scene, 90, number, t_ns, rng))
    for camera in CAMERAS:
        (root / camera).mkdir()
        for t_ns in (START_NS, START_NS + 100_000_000):
            image_path(root, camera, t_ns).write_bytes(b"\xff\xd8" + rng.bytes(64) + b"\xff\xd9")
    names = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    t_ns = START_NS + 5_000_000 * np.arange(100)
    write_table(root / "imu.parquet", {"t_ns": t_ns} | {name: rng.normal(size=100) for name in names}, "imu")
    sensor = {"model": "simulated", "clock": "synchronised"}
    write_description(
        root,
        {
            "id": "a_drive",
            "rig": "a car",
            "day": "2026-04-14",
            "place": "Musterforst",
            "country": "DE",
            "sensors": dict.fromkeys((*CAMERAS, "imu"), sensor)
            | {name: {**sensor, "deskewed": False} for name in LIDARS},
        },
    )
    (root / "annotations" / "labels").mkdir(parents=True)
    (root / "annotations" / "classes.txt").write_text("speed_bump\n")
    (root / "privacy_labels.csv").write_text("camera,t_ns\n")
    return root


def _imported(native: Path, root: Path) -> Path:
    (root / "delivered").mkdir()
    deliveries.as_bag(native, root / "delivered")
    import_bag(
        recording=root / "delivered",
        out=root / "back",
        report=root / "report.json",
        settings=default_settings("ingest"),
    )
    return root / "back"


def _sorted(burst: Burst) -> Burst:
    order = np.lexsort((burst.ring, burst.time_ns))
    return Burst(
        burst.t_ns,
        burst.points[order],
        burst.intensity[order],
        burst.ring[order],
        burst.offset_ns[order],
    )


def test_a_bag_comes_back_as_the_recording_it_was_made_of(native: Path, tmp_path: Path) -> None:
    back = _imported(native, tmp_path)
    for lidar in LIDARS:
        before, after = list_bursts(native, lidar), list_bursts(back, lidar)
        assert len(before) == len(after) == TURNS
        for one, other in zip(before, after, strict=True):
            sent, got = _sorted(read_burst(one)), _sorted(read_burst(other))
            assert np.array_equal(sent.ring, got.ring)
            assert np.array_equal(sent.intensity, got.intensity)
            # Packets have a time in whole microseconds, LAZ has 0.1 mm.
            assert np.abs(sent.time_ns - got.time_ns).max() <= 1_000
            assert np.abs(sent.points - got.points).max() <= 2e-4
    for camera in CAMERAS:
        assert [p.name for p in list_images(native, camera)] == [p.name for p in list_images(back, camera)]
        for path in list_images(native, camera):
            assert (back / camera / path.name).read_bytes() == path.read_bytes()
    assert read_table(native / "imu.parquet", "imu").equals(read_table(back / "imu.parquet", "imu"))


def test_what_is_no_sensor_s_lies_beside_the_bag(native: Path, tmp_path: Path) -> None:
    deliveries.as_bag(native, tmp_path)
    assert (tmp_path / "annotations" / "classes.txt").read_text() == "speed_bump\n"
    assert (tmp_path / "privacy_labels.csv").is_file()
    assert not any((tmp_path / sensor).exists() for sensor in (*CAMERAS, *LIDARS, "imu.parquet"))
    description = read_description(tmp_path)
    assert description["sensors"]["lidar_front"]["column_period_ns"] == 1_111_111
    assert set(description["bag"]["topics"]) == {*CAMERAS, *LIDARS, "imu"}


def test_same_recording_same_bag(native: Path, tmp_path: Path) -> None:
    files = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        deliveries.as_bag(native, tmp_path / name)
        folder = tmp_path / name
        files.append({p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()})
    assert files[0] == files[1]


def _drive(seconds: float) -> Trajectory:
    t = np.arange(0, seconds, 0.005)
    yaw = 0.4 * np.sin(t / 9)
    half = np.stack([np.cos(yaw / 2), 0 * t, 0 * t, np.sin(yaw / 2)], axis=1)
    xyz = np.stack([20 * np.sin(t / 9), 8 * t, 0.05 * np.sin(3 * t)], axis=1)
    return Trajectory(START_NS + np.rint(t * 1e9).astype(np.int64), xyz, half)


def _errors(tmp_path: Path, truth: Trajectory, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors (N, 6) in the world, m and rad, once aligned; ``tum_from_world`` (4, 4)."""
    deliveries.write_trajectory(tmp_path, truth, seed)
    t_ns, poses = read_tum(tmp_path / "trajectory.tum", 1e-6)
    assert np.array_equal(t_ns, truth.t_ns)
    true = truth.at(t_ns)
    # The frames differ by a shift and a turn about the vertical, whose least squares are in closed form.
    a, b = true[:, :3, 3], poses[:, :3, 3]
    x, y = (a - a.mean(0))[:, :2].T @ (b - b.mean(0))[:, :2]
    half = np.arctan2(x[1] - y[0], x[0] + y[1]) / 2
    turn = transform(np.zeros(3), [np.cos(half), 0, 0, np.sin(half)])
    tum_from_world = transform(b.mean(0) - apply(turn, a.mean(0))) @ turn
    aligned = inverse(tum_from_world) @ poses
    rotation = aligned[:, :3, :3] @ np.swapaxes(true[:, :3, :3], 1, 2)
    vector = 2 * quaternion_from_matrix(rotation)[:, 1:]
    return np.concatenate([aligned[:, :3, 3] - true[:, :3, 3], vector], axis=1), tum_from_world


def test_the_delivered_trajectory_is_the_truth_up_to_its_noise(tmp_path: Path) -> None:
    truth = _drive(45)
    rms = []
    for seed in range(5):
        errors, tum_from_world = _errors(tmp_path, truth, seed)
        rms.append(np.sqrt(np.mean(np.sum(errors.reshape(-1, 2, 3) ** 2, axis=2), axis=0)))
        fast = np.diff(errors[:, :3], axis=0)
        assert np.abs(fast).max() < 1e-3, "no step between neighbours beyond a millimetre"
        assert np.linalg.norm(tum_from_world[:3, 3]) > 1, "a frame of its own"
    position, angle = np.median(rms, axis=0)
    assert 0.004 < position < 0.012  # the alignment takes some of the 1 cm
    assert np.radians(0.01) < angle < np.radians(0.03)


def test_over_a_second_the_delivered_trajectory_is_true_to_a_few_millimetres(tmp_path: Path) -> None:
    errors, _ = _errors(tmp_path, _drive(60), seed=3)
    relative = errors[200:, :3] - errors[:-200, :3]
    assert np.sqrt(np.mean(np.sum(relative**2, axis=1))) < 0.004


def test_seeds_and_drives_have_noise_of_their_own(tmp_path: Path) -> None:
    def delivered(truth: Trajectory, seed: int) -> bytes:
        deliveries.write_trajectory(tmp_path, truth, seed)
        return (tmp_path / "trajectory.tum").read_bytes()

    truth = _drive(2)
    assert delivered(truth, 1) == delivered(truth, 1)
    assert delivered(truth, 1) != delivered(truth, 2)
