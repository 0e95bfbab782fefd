"""The error measures of the accuracy tables, on errors that are known."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from card.geometry import Trajectory, quaternion_from_matrix, transform
from card.simulation.calibrations import true_calibration


@pytest.fixture(autouse=True)
def benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules of benchmarks/ import each other as its scripts do; no other system runs here."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    monkeypatch.delenv("CARD_REFERENCE_PYTHON", raising=False)


def accuracy(name: str) -> ModuleType:
    path = Path(__file__).parents[2] / "benchmarks" / "accuracy" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"accuracy_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def bend() -> np.ndarray:
    t = np.linspace(0, 10, 501)
    rotation = Rotation.from_euler("ZXY", np.stack([0.3 * t, 0.05 * np.sin(t), 0.02 * np.cos(t)], axis=1))
    position = np.stack([20 * np.cos(0.3 * t), 20 * np.sin(0.3 * t), np.sin(t)], axis=1)
    return transform(position, rotation.as_quat()[:, [3, 0, 1, 2]])


def trajectory(poses: np.ndarray) -> Trajectory:
    return Trajectory(
        np.arange(len(poses)) * 20_000_000, poses[:, :3, 3], quaternion_from_matrix(poses[:, :3, :3])
    )


def test_another_world_is_no_error_but_in_tilt() -> None:
    poses = bend()
    half = np.radians(0.25)
    moved = transform([3, -2, 1], [np.cos(half), np.sin(half), 0, 0]) @ poses
    errors = accuracy("poses").trajectory_errors(trajectory(moved), trajectory(poses))
    assert errors["ate_cm"] < 1e-6
    assert errors["rpe_1s_cm"] < 1e-6
    assert errors["tilt_deg"] == pytest.approx(0.5, rel=1e-6)


def test_alignment_agrees_with_scipy() -> None:
    rng = np.random.default_rng(0)
    points, reference = bend()[:, :3, 3], bend()[:, :3, 3] @ Rotation.random(rng=rng).as_matrix()
    reference = reference + rng.normal(0, 0.1, reference.shape)
    found = accuracy("poses").align(reference, points)
    witness, _ = Rotation.align_vectors(reference - reference.mean(axis=0), points - points.mean(axis=0))
    np.testing.assert_allclose(found[:3, :3], witness.as_matrix(), atol=1e-6)


def test_a_constant_drift_shows_in_rpe() -> None:
    poses = bend()
    drifted = poses.copy()
    drifted[:, 2, 3] += 0.002 * np.linspace(0, 10, 501)
    errors = accuracy("poses").trajectory_errors(trajectory(drifted), trajectory(poses))
    assert errors["rpe_1s_cm"] == pytest.approx(0.2, rel=1e-3)


def test_errors_are_those_of_evo() -> None:
    from evo.core import metrics, sync
    from evo.core.trajectory import PoseTrajectory3D

    rng = np.random.default_rng(3)
    true, found = bend(), bend()
    found[:, :3, 3] += np.cumsum(rng.normal(0, 2e-3, (len(found), 3)), axis=0)
    found = transform([1, 2, 3], [np.cos(0.2), 0, 0, np.sin(0.2)]) @ found
    seconds = np.arange(len(true)) * 0.02
    theirs = [PoseTrajectory3D(poses_se3=list(poses), timestamps=seconds) for poses in (true, found)]
    reference, estimate = sync.associate_trajectories(*theirs)
    rpe = metrics.RPE(
        metrics.PoseRelation.translation_part, delta=50, delta_unit=metrics.Unit.frames, all_pairs=True
    )
    rpe.process_data((reference, estimate))
    estimate.align(reference)
    ate = metrics.APE(metrics.PoseRelation.translation_part)
    ate.process_data((reference, estimate))
    errors = accuracy("poses").trajectory_errors(trajectory(found), trajectory(true))
    assert errors["ate_cm"] == pytest.approx(100 * ate.get_statistic(metrics.StatisticsType.rmse), rel=1e-6)
    assert errors["rpe_1s_cm"] == pytest.approx(
        100 * rpe.get_statistic(metrics.StatisticsType.rmse), rel=1e-6
    )


def test_a_second_round_that_lies_higher_shows_at_revisits() -> None:
    angle = np.linspace(0, 4 * np.pi, 1201)
    flat = np.stack([20 * np.cos(angle), 20 * np.sin(angle), 0 * angle], axis=1)
    higher = flat + np.outer(angle > 2 * np.pi, [0, 0, 0.02])
    errors = accuracy("poses").trajectory_errors(trajectory(transform(higher)), trajectory(transform(flat)))
    assert errors["revisit_z_mm"] == pytest.approx(20, abs=0.5)
    assert np.isnan(accuracy("poses").revisit_z(trajectory(bend()), trajectory(bend())))


def test_bundle_errors_are_those_put_in() -> None:
    module = accuracy("calibration")
    true = true_calibration("2026-04-14-start", 1, "tiny")
    assert max(module.bundle_errors(true, true).values()) < 1e-9
    found = true_calibration("2026-04-14-start", 1, "tiny")
    found["extrinsics"]["rig_from_lidar_rear"]["translation_m"][0] += 0.004
    found["wheels"]["rl"]["contact_m"][2] -= 0.003
    errors = module.bundle_errors(found, true)
    assert errors["rear_mm"] == pytest.approx(4)
    assert errors["wheel_contact_mm"] == pytest.approx(3)
    assert errors["stereo_mm"] < 1e-9
    assert errors["imu_mm"] < 1e-9
    for name in ("front", "rear"):
        found["extrinsics"][f"rig_from_lidar_{name}"]["translation_m"][1] += 0.002
    assert module.bundle_errors(found, true)["imu_mm"] == pytest.approx(2)
    assert module.bundle_errors(found, true)["rear_mm"] == pytest.approx(4)
    assert module.angle_deg(Rotation.from_rotvec([0, 1e-6, 0]).as_matrix()) == pytest.approx(np.degrees(1e-6))


def test_missing_results_give_no_value(tmp_path: Path) -> None:
    for stage, count in (("poses", 12), ("wheels", 9), ("calibration", 9)):
        rows = accuracy(stage).rows(tmp_path, tmp_path, ["nowhere"])
        assert [row["value"] for row in rows] == [None] * count
