"""Stage 2 on streets of boxes: loops proved by geometry, weak spots named, the IMU followed between nodes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_stages import expected, figures, refined, run
from scipy.spatial.transform import Rotation
from street_scene import START_NS, Street, houses

from card.artifacts import default_settings, read_json, read_table, write_table
from card.errors import CardError
from card.estimation.batch import Nodes
from card.estimation.dense import dense_trajectory
from card.estimation.odometry import plane_settings
from card.geometry import Trajectory, inverse, transform
from card.poses.inputs import open_imu, open_scans
from card.poses.loops import LoopVerifier, candidates, travelled
from card.poses.map_quality import map_figures
from card.poses.sweep_store import SweepStore, along_trajectory
from card.poses.take_refined import take_refined

NEAR = {"loop_min_way_m": 8.0, "loop_coarse_m": 4.0, "loop_spacing_m": 2.0, "loop_radius_m": 3.0}


def there_and_back(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Twelve metres along y and back in reverse, in six seconds."""
    y = 6 * (1 - np.cos(2 * np.pi * t / 6))
    position = np.stack([0.1 * np.sin(t), y, 0.02 * np.sin(4 * t)], axis=1)
    body = np.stack([0.15 * np.sin(t), 0.02 * np.sin(3 * t), 0.03 * np.sin(2.2 * t)], axis=1)
    return position, Rotation.from_euler("ZXY", body)


@pytest.fixture(scope="module")
def street() -> Street:
    return Street(houses(length=40), there_and_back, seconds=6.0)


@pytest.fixture(scope="module")
def folder(street: Street, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return street.record(tmp_path_factory.mktemp("street") / "drive")


@pytest.fixture(scope="module")
def report(folder: Path) -> dict[str, Any]:
    return run(folder, **NEAR)


def test_a_drive_with_loops_is_refined_to_millimetres(
    street: Street, folder: Path, report: dict[str, Any]
) -> None:
    path = refined(folder)
    true = expected(street, path.t_ns)
    assert np.linalg.norm(path.translation_m - true[:, :3, 3], axis=1).max() < 0.01
    values = figures(report)
    assert values["loops"] >= 3
    assert values["loops_rejected"] == 0
    assert values["loop_residual_mm"] < 5
    assert values["weak_pct"] == 0
    loops = read_table(folder / "loops.parquet", "loops")
    assert loops.num_rows == values["loops"]
    first, second = (np.asarray(loops[f"{name}_t_ns"]) for name in ("first", "second"))
    measured = transform(
        np.stack([loops[a].to_numpy() for a in "xyz"], axis=1),
        np.stack([loops[f"q{a}"].to_numpy() for a in "wxyz"], axis=1),
    )
    really = inverse(street.poses(first)) @ street.poses(second)
    assert np.linalg.norm((measured - really)[:, :3, 3], axis=1).max() < 0.01


def test_biases_lie_within_their_sigmas(street: Street, folder: Path, report: dict[str, Any]) -> None:
    nodes = read_table(folder / "nodes.parquet", "pose_graph_nodes")
    for name, true in (("gyro", street.gyro_bias), ("accel", street.accel_bias)):
        for axis, value in zip("xyz", true, strict=True):
            found = nodes[f"{name}_bias_{axis}"].to_numpy()
            sigma = nodes[f"{name}_bias_sigma_{axis}"].to_numpy()
            assert (np.abs(found - value) < 3 * sigma).all(), f"{name} {axis}"


def test_the_same_odometry_gives_the_same_bytes(folder: Path, report: dict[str, Any]) -> None:
    names = ("refined.parquet", "nodes.parquet", "loops.parquet", "graph.g2o", "pose_graph.report.json")
    before = {name: (folder / name).read_bytes() for name in names}
    run(folder, **NEAR)
    assert {name: (folder / name).read_bytes() for name in names} == before


def test_without_revisits_the_record_says_so(
    street: Street, folder: Path, report: dict[str, Any], tmp_path: Path
) -> None:
    for name in ("odometry", "bursts", "imu"):
        (tmp_path / f"{name}.parquet").write_bytes((folder / f"{name}.parquet").read_bytes())
    for name in ("calibration.json", "recording.yaml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    (tmp_path / "lidar_front").symlink_to(folder / "lidar_front")
    alone = run(tmp_path)
    assert "no loop: drift over the whole drive is not corrected by revisits" in alone["notes"]
    path = refined(tmp_path)
    error = path.translation_m - expected(street, path.t_ns)[:, :3, 3]
    assert np.linalg.norm(error, axis=1).max() < 0.02


def test_the_refined_trajectory_becomes_the_poses(folder: Path, report: dict[str, Any]) -> None:
    t_ns = START_NS + np.arange(10, 30) * 100_000_000 + 7
    empty = [None] * len(t_ns)
    frames = {
        "frame": np.arange(len(t_ns)),
        "t_ns": t_ns,
        "left_file": [f"camera_left/{t}.jpg" for t in t_ns],
        "right_file": empty,
        "right_t_ns": empty,
        "lidar_front_burst": empty,
        "lidar_rear_burst": empty,
    }
    write_table(folder / "frames.parquet", frames, "frames")
    settings = default_settings("poses") | {"revisit_min_way_m": 8.0, "quality_spacing_m": 1.0}
    take_refined(
        refined=folder / "refined.parquet",
        recording=folder,
        calibration=folder / "calibration.json",
        bursts=folder / "bursts.parquet",
        frames=folder / "frames.parquet",
        trajectory=folder / "trajectory.parquet",
        poses=folder / "poses.json",
        report=folder / "poses.report.json",
        settings=settings,
        gates=[],
    )
    rows = json.loads((folder / "poses.json").read_text())["poses"]
    assert len([row for row in rows if row["kind"] == "image"]) == len(t_ns)
    values = figures(read_json(folder / "poses.report.json", "report"))
    assert values["revisits"] > 3
    assert values["revisit_z_mm"] < 5
    assert values["map_thickness_mm"] < 12
    assert values["gravity_error_deg"] < 0.2
    path = refined(folder)
    written = Trajectory.from_table(read_table(folder / "trajectory.parquet", "trajectory"))
    np.testing.assert_allclose(written.translation_m, path.at(written.t_ns)[:, :3, 3], atol=1e-9)


def test_a_step_in_height_shows_in_the_map(street: Street, folder: Path) -> None:
    t_ns = np.asarray(read_table(folder / "imu.parquet", "imu")["t_ns"])
    true = street.truth(t_ns)
    lifted = true.translation_m + np.outer(t_ns > START_NS + 3e9, [0, 0, 0.05])
    settings = default_settings("poses") | {"revisit_min_way_m": 8.0, "quality_spacing_m": 1.0}
    found = {}
    for name, path in (("true", true), ("lifted", Trajectory(t_ns, lifted, true.rotation_wxyz))):
        table = read_table(folder / "bursts.parquet", "bursts")
        calibration = read_json(folder / "calibration.json", "calibration")
        listed = map_figures(folder, table, calibration, {}, path, settings)
        found[name] = {figure.name: figure.value for figure in listed}
    assert found["true"]["revisit_z_mm"] < 3
    assert found["lifted"]["revisit_z_mm"] == pytest.approx(50, abs=5)
    assert found["lifted"]["map_thickness_mm"] > 1.5 * found["true"]["map_thickness_mm"]


def verifier(street: Street, folder: Path) -> tuple[LoopVerifier, np.ndarray]:
    """On true motion: what a loop is proved with, and the true poses of its sweeps."""
    odometry = default_settings("odometry")
    scans = open_scans(folder, folder / "bursts.parquet", folder / "calibration.json", odometry)
    t_ns = np.asarray(read_table(folder / "imu.parquet", "imu")["t_ns"])
    motion = along_trajectory(street.truth(t_ns))
    store = SweepStore(scans, np.arange(len(scans)), motion, odometry["map_points_leaf_m"])
    settings = default_settings("pose_graph") | NEAR | {"scan_leaf_m": odometry["scan_leaf_m"]}
    return LoopVerifier(store, plane_settings(odometry), settings), street.poses(scans.end_ns)


def test_a_loop_is_proved_from_nine_metres_off(street: Street, folder: Path) -> None:
    prove, true = verifier(street, folder)
    drifted = true.copy()
    drifted[30:, :3, 3] += 6.0, -6.5, 1.0
    loop = prove.verify(drifted, 5, 54, drift_m=9.0)
    assert loop.accepted
    error = loop.found.map_from_scan - inverse(true[5]) @ true[54]
    assert np.linalg.norm(error[:3, 3]) < 0.01


def test_another_place_is_no_loop(street: Street, folder: Path, tmp_path: Path) -> None:
    other = Street(houses(length=40, seed=7), there_and_back, seconds=0.6).record(tmp_path / "other")
    for path in sorted((folder / "lidar_front").iterdir()):
        (tmp_path / "mixed" / "lidar_front").mkdir(parents=True, exist_ok=True)
        (tmp_path / "mixed" / "lidar_front" / path.name).symlink_to(path)
    for name in ("bursts.parquet", "imu.parquet", "calibration.json", "recording.yaml"):
        (tmp_path / "mixed" / name).write_bytes((folder / name).read_bytes())
    replaced = sorted((tmp_path / "mixed" / "lidar_front").iterdir())[54]
    replaced.unlink()
    strange = sorted((other / "lidar_front").iterdir())[2]
    replaced.write_bytes(strange.read_bytes())
    prove, true = verifier(street, tmp_path / "mixed")
    assert not prove.verify(true, 5, 54, drift_m=0.0).accepted


def test_every_pass_by_a_place_is_a_candidate_of_its_own() -> None:
    angle = np.linspace(0, 6 * np.pi, 601)
    poses = transform(np.stack([20 * np.cos(angle), 20 * np.sin(angle), 0 * angle], axis=1))
    pairs = candidates(poses, spacing_m=30.0, radius_m=3.0, min_way_m=60.0)
    way = travelled(poses)
    assert pairs
    for earlier, later in pairs:
        assert way[later] - way[earlier] > 60
        # The nearest node of the pass, or the drive's first where it begins within the radius.
        assert np.linalg.norm(poses[earlier, :3, 3] - poses[later, :3, 3]) < (0.4 if earlier else 3.0)
    last = max(later for _, later in pairs)
    assert len([pair for pair in pairs if pair[1] == last]) == 2
    # Where places may have drifted, only the latest visit counts: drift grows from round to round.
    drifted = poses.copy()
    drifted[:, 2, 3] = 0.03 * way
    assert not candidates(drifted, spacing_m=30.0, radius_m=3.0, min_way_m=60.0)
    pairs = candidates(drifted, spacing_m=30.0, radius_m=3.0, min_way_m=60.0, drift_share=0.03)
    assert pairs
    assert all(60 < way[later] - way[earlier] < 160 for earlier, later in pairs)


def test_between_nodes_the_trajectory_follows_the_imu_through_them(street: Street, folder: Path) -> None:
    imu = open_imu(folder, folder / "calibration.json").without(street.gyro_bias, street.accel_bias)
    t_ns = START_NS + np.arange(2, 57, 3) * 100_000_000 + 1_234_567
    speed = (street.poses(t_ns + 100_000) - street.poses(t_ns - 100_000))[:, :3, 3] / 2e-4
    zero = np.zeros((len(t_ns), 3))
    nodes = Nodes(t_ns, street.poses(t_ns), speed, zero, zero, np.array([0, 0, -9.81]))
    path = dense_trajectory(nodes, imu, beyond_s=0.1)
    assert np.isin(path.t_ns, imu.t_ns).all()
    assert path.start_ns <= t_ns[0] - 95_000_000
    inside = (path.t_ns >= t_ns[0]) & (path.t_ns <= t_ns[-1])
    error = path.translation_m - street.poses(path.t_ns)[:, :3, 3]
    assert np.linalg.norm(error[inside], axis=1).max() < 5e-4
    # Straight lines between nodes 0.3 s apart would miss the heaving body by millimetres.
    straight = np.stack([np.interp(path.t_ns, t_ns, nodes.poses[:, axis, 3]) for axis in range(3)], axis=1)
    assert np.linalg.norm((straight - street.poses(path.t_ns)[:, :3, 3])[inside], axis=1).max() > 0.01


def test_an_imu_that_ends_early_is_refused(folder: Path, report: dict[str, Any], tmp_path: Path) -> None:
    for name in ("odometry.parquet", "bursts.parquet", "calibration.json", "recording.yaml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    table = read_table(folder / "imu.parquet", "imu")
    write_table(tmp_path / "imu.parquet", table.slice(0, 600), "imu")
    with pytest.raises(CardError, match="IMU does not cover a requested time"):
        run(tmp_path)
    assert not (tmp_path / "refined.parquet").exists()
