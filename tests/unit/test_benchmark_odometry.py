"""Odometry: known errors, the independent evaluator evo, and every way trajectories can be wrong."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmark_release import RIG_FROM, START_NS, STEP_NS, build_tree, pose
from evo.core import metrics as evo_metrics
from evo.core.trajectory import PosePath3D

from card.artifacts import default_settings, read_json
from card.benchmark import odometry_metrics as metrics
from card.benchmark.odometry import evaluate_odometry
from card.cli import main
from card.errors import CardError
from card.geometry import quaternion_from_matrix, transform

FRAMES = 400
TIMES = [START_NS + frame * STEP_NS for frame in range(-1, FRAMES + 2)]
TRUTH = np.array([pose(t_ns) @ RIG_FROM["camera_left"] for t_ns in TIMES])
WORLD = transform([5, -3, 2], [0.8, 0.1, -0.2, 0.55] / np.linalg.norm([0.8, 0.1, -0.2, 0.55]))


def drifting(rotation_rad: float = 0.0, scale: float = 1.0, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Poses whose every step turns a little too far, is a little too long and a little wrong."""
    rng = np.random.default_rng(seed)
    poses = [WORLD @ TRUTH[0]]
    for before, after in pairwise(TRUTH):
        step = np.linalg.inv(before) @ after
        step[:3, 3] = scale * step[:3, 3] + rng.normal(0, noise, 3)
        turn = transform([0, 0, 0], [np.cos(rotation_rad / 2), 0, np.sin(rotation_rad / 2), 0])
        poses.append(poses[-1] @ step @ turn)
    return np.array(poses)


def evo_figure(metric: Any, estimate: np.ndarray) -> float:
    metric.process_data((PosePath3D(poses_se3=list(TRUTH)), PosePath3D(poses_se3=list(estimate))))
    return float(metric.get_statistic(evo_metrics.StatisticsType.rmse))


def test_absolute_and_relative_errors_are_those_of_evo() -> None:
    estimate = drifting(1e-3, 1.02, 0.02)
    for with_scale in (False, True):
        path = PosePath3D(poses_se3=list(estimate))
        path.align(PosePath3D(poses_se3=list(TRUTH)), correct_scale=with_scale)
        wanted = evo_figure(
            evo_metrics.APE(evo_metrics.PoseRelation.translation_part), np.array(path.poses_se3)
        )
        assert metrics.absolute_error(TRUTH, estimate, with_scale)[0] == pytest.approx(wanted, rel=1e-9)
    each = np.arange(len(TRUTH) - 1)
    moved, turned = metrics.relative_errors(TRUTH, estimate, each, each + 1)
    for found, relation in (
        (np.sqrt(np.mean(moved**2)), evo_metrics.PoseRelation.translation_part),
        (np.degrees(np.sqrt(np.mean(turned**2))), evo_metrics.PoseRelation.rotation_angle_deg),
    ):
        assert found == pytest.approx(evo_figure(evo_metrics.RPE(relation), estimate), rel=1e-5)


def test_another_world_is_no_error() -> None:
    ate, scale = metrics.absolute_error(TRUTH, drifting(), with_scale=True)
    assert ate == pytest.approx(0, abs=1e-6)
    assert scale == pytest.approx(1, abs=1e-9)


def test_a_longer_step_is_drift_in_percent_and_a_scale() -> None:
    estimate = drifting(scale=1.05)
    first, last, length = metrics.segments(TRUTH, [100, 200])
    moved, turned = metrics.relative_errors(TRUTH, estimate, first, last)
    # A segment ends up to a frame beyond its length, and the bend makes its chord shorter.
    assert 100 * np.mean(moved / length) == pytest.approx(5, rel=0.03)
    assert turned == pytest.approx(0, abs=1e-6)
    assert metrics.absolute_error(TRUTH, estimate, with_scale=True)[1] == pytest.approx(1 / 1.05, rel=1e-9)


def test_a_turn_too_far_is_drift_in_degrees() -> None:
    estimate = drifting(rotation_rad=1e-3)
    first, last, length = metrics.segments(TRUTH, [100])
    _, turned = metrics.relative_errors(TRUTH, estimate, first, last)
    frames = last - first
    assert np.degrees(turned) == pytest.approx(np.degrees(1e-3) * frames, rel=0.05)
    assert (length == 100).all()
    assert len(first) > 10


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("release"))


def write(folder: Path, estimate: np.ndarray, name: str = "long") -> Path:
    folder.mkdir(exist_ok=True)
    lines = ["# t x y z qx qy qz qw"]
    for t_ns, matrix in zip(TIMES, estimate, strict=True):
        w, x, y, z = quaternion_from_matrix(matrix[:3, :3])
        values = [*matrix[:3, 3], x, y, z, w]
        lines.append(" ".join([f"{t_ns // 10**9}.{t_ns % 10**9:09d}", *(f"{value:.9f}" for value in values)]))
    (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return folder


def run(tree: Path, predictions: Path) -> dict[str, Any]:
    return evaluate_odometry(
        release=tree,
        split="zero_shot",
        method="dead reckoning",
        predictions=predictions,
        out=predictions.with_name("out"),
        report=predictions.with_name("out.report.json"),
        settings=default_settings("benchmark"),
    )


def test_a_trajectory_is_scored(tree: Path, tmp_path: Path) -> None:
    document = run(tree, write(tmp_path / "p", drifting(scale=1.05)))
    assert document == read_json(tmp_path / "out" / "odometry.json", "odometry")
    assert document["counts"] | {"segments": 0} == {
        "sequences": 1, "sequences_without_poses": 0, "frames": 403, "frames_not_predicted": 0, "segments": 0,
    }  # fmt: skip
    assert document["counts"]["segments"] > 50
    assert document["mean"]["drift_translation_pct"] == pytest.approx(5, rel=0.03)
    assert document["mean"]["ate_scaled_rmse_m"] < 1e-3 < document["mean"]["ate_rmse_m"]
    steps = np.linalg.norm(np.diff(TRUTH[:, :3, 3], axis=0), axis=1)
    assert document["mean"]["rpe_translation_m"] == pytest.approx(0.05 * np.sqrt(np.mean(steps**2)), rel=1e-3)
    text = (tmp_path / "out" / "table.md").read_text()
    assert "1 sequences" in text
    assert "| long | 403 |" in text


def test_frames_may_be_left_out_and_are_counted(tree: Path, tmp_path: Path) -> None:
    path = write(tmp_path / "p", drifting()) / "long.txt"
    path.write_text("\n".join(path.read_text().splitlines()[50:]))
    assert run(tree, tmp_path / "p")["counts"]["frames_not_predicted"] == 49


def test_the_command_evaluates_trajectories(
    tree: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write(tmp_path / "p", drifting())
    given = ["evaluate", "--release", str(tree), "--task", "odometry", "--predictions", str(folder)]
    assert main([*given, "--out", str(tmp_path / "o")]) == 0
    assert "# p on card-test 0.1.0, zero_shot" in capsys.readouterr().out


def line(path: Path, number: int, text: str) -> None:
    lines = path.read_text().splitlines()
    lines[number] = text
    path.write_text("\n".join(lines))


STAMP = f"{START_NS // 10**9}"
SPOILED = {
    "prediction is missing": lambda path: path.unlink(),
    "not a prediction of this split": lambda path: write(path.parent, drifting(), "other"),
    "not a line of a TUM trajectory": lambda path: line(path, 3, "1 2 3"),
    "long.txt:4: no pose .found quaternion of length 2": lambda path: line(path, 3, f"{STAMP} 0 0 0 0 0 0 2"),
    "no pose": lambda path: line(path, 3, f"{STAMP} nan 0 0 0 0 0 1"),
    "pose of no frame": lambda path: line(path, 3, f"{STAMP}.05 0 0 0 0 0 0 1"),
    "frame given twice": lambda path: line(path, 4, path.read_text().splitlines()[3]),
    "trajectory is too short": lambda path: path.write_text(f"{STAMP} 0 0 0 0 0 0 1\n"),
}


@pytest.mark.parametrize("message", SPOILED)
def test_bad_trajectories_are_named(tree: Path, tmp_path: Path, message: str) -> None:
    SPOILED[message](write(tmp_path / "p", drifting()) / "long.txt")
    with pytest.raises(CardError, match=message) as caught:
        run(tree, tmp_path / "p")
    assert "long" in str(caught.value) or "other" in str(caught.value)
    assert not (tmp_path / "out").exists()
