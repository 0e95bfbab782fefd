"""The batch on graphs whose solution is known: drift, false loops, biases, gravity, and its g2o dump."""

from pathlib import Path

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import B, G
from scipy.spatial.transform import Rotation

from card.estimation.batch import Batch, Between, Nodes, between_error, residuals, write_g2o
from card.estimation.imu import Imu, ImuNoise
from card.estimation.strapdown import integrate
from card.geometry import transform
from card.poses.refine import OUTLIER, robust

NOISE = ImuNoise(1e-4, 1e-3, 1e-6, 2e-5, 2e-3, 0.03)
GRAVITY = np.array([0, 0, -9.81])
GYRO_BIAS, ACCEL_BIAS = np.array([8e-4, -5e-4, 1e-3]), np.array([0.02, -0.015, 0.01])
START_NS = 1_776_153_600_000_000_000
STEP_S, SECONDS = 0.5, 130.0
RADIUS, RATE = 95.0, 2 * np.pi / 60  # a round of 600 m takes a minute
SIGMA = np.repeat([2e-4, 3e-3], 3)


def motion(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Two rounds on a circle, the body swaying."""
    yaw = RATE * t
    position = np.stack([RADIUS * (np.cos(yaw) - 1), RADIUS * np.sin(yaw), 0.3 * np.sin(0.2 * t)], axis=1)
    body = np.stack([yaw, 0.02 * np.sin(1.3 * t), 0.03 * np.sin(0.9 * t)], axis=1)
    return position, Rotation.from_euler("ZXY", body)


@pytest.fixture(scope="module")
def imu() -> Imu:
    rng = np.random.default_rng(0)
    t = np.arange(0, SECONDS + 0.005, 0.01)
    h = 1e-4
    (before, r0), (now, r), (after, r1) = (motion(t + d) for d in (-h, 0, h))
    gyro = (r0.inv() * r1).as_rotvec() / (2 * h) + GYRO_BIAS + rng.normal(0, 1e-4 * 10, (len(t), 3))
    force = (after - 2 * now + before) / h**2 - GRAVITY
    accel = r.inv().apply(force) + ACCEL_BIAS + rng.normal(0, 1e-3 * 10, (len(t), 3))
    return Imu(START_NS + np.round(t * 1e9).astype(np.int64), gyro, accel)


def true_nodes() -> Nodes:
    t = np.arange(0, SECONDS, STEP_S)
    position, rotation = motion(t)
    poses = transform(position, rotation.as_quat()[:, [3, 0, 1, 2]])
    velocity = (motion(t + 1e-4)[0] - motion(t - 1e-4)[0]) / 2e-4
    zero = np.zeros_like(velocity)
    return Nodes(START_NS + np.round(t * 1e9).astype(np.int64), poses, velocity, zero, zero, GRAVITY)


def chained(true: Nodes, drift: object = 0.0, seed: int = 1) -> tuple[Nodes, list[Between]]:
    """Odometry whose every step is off by a drift (3,) in world, m, and the poses that it leads to."""
    rng = np.random.default_rng(seed)
    poses, steps = [true.poses[0]], []
    for k in range(len(true.t_ns) - 1):
        step = np.linalg.inv(true.poses[k]) @ true.poses[k + 1]
        step[:3, 3] += true.poses[k, :3, :3].T @ np.broadcast_to(drift, 3)
        noise = np.eye(4)
        noise[:3, :3] = Rotation.from_rotvec(rng.normal(0, SIGMA[0], 3)).as_matrix()
        noise[:3, 3] = rng.normal(0, SIGMA[3], 3)
        steps.append(Between(k, k + 1, step @ noise, np.diag(SIGMA**-2)))
        poses.append(poses[-1] @ steps[-1].first_from_second)
    return Nodes(**{**true.__dict__, "poses": np.stack(poses)}), steps


def loops(true: Nodes, every: int) -> list[Between]:
    round_ = round(60 / STEP_S)
    return [
        Between(k, k + round_, np.linalg.inv(true.poses[k]) @ true.poses[k + round_], np.diag(SIGMA**-2))
        for k in range(0, len(true.t_ns) - round_, every)
    ]


def worst(found: Nodes, true: Nodes) -> float:
    """Greatest error of position, the first poses laid over each other, m."""
    moved = np.linalg.inv(found.poses[0]) @ found.poses
    wanted = np.linalg.inv(true.poses[0]) @ true.poses
    return float(np.linalg.norm(moved[:, :3, 3] - wanted[:, :3, 3], axis=1).max())


def test_strapdown_follows_the_closed_form(imu: Imu) -> None:
    true = true_nodes()
    samples = imu.between(int(true.t_ns[0]), int(true.t_ns[4])).without(GYRO_BIAS, ACCEL_BIAS)
    path = integrate(samples, true.poses[0], true.velocities[0], GRAVITY)
    np.testing.assert_allclose(path.position[-1], true.poses[4, :3, 3], atol=0.01)
    back = integrate(samples.backwards(), true.poses[4], true.velocities[4], GRAVITY)
    np.testing.assert_allclose(back.position[-1], true.poses[0, :3, 3], atol=0.01)


def test_biases_and_gravity_are_found_within_their_sigmas(imu: Imu) -> None:
    true = true_nodes()
    start, steps = chained(true)
    tilted = np.array([0.2, -0.1, -9.8])
    start = Nodes(**{**start.__dict__, "gravity": 9.81 * tilted / np.linalg.norm(tilted)})
    batch = Batch(imu, start, NOISE)
    found = batch.solve(start, steps)
    sigma = batch.uncertainty([100])
    assert (np.abs(found.gyro_biases[100] - GYRO_BIAS) < 3 * sigma.gyro_biases[0] + 1e-6).all()
    assert (np.abs(found.accel_biases[100] - ACCEL_BIAS) < 3 * sigma.accel_biases[0]).all()
    tilt = np.arccos(found.gravity @ GRAVITY / 9.81**2)
    assert tilt < 3.5 * np.linalg.norm(sigma.gravity)
    assert np.degrees(tilt) < 0.02


def test_nine_metres_of_drift_are_pulled_in_by_true_loops(imu: Imu) -> None:
    true = true_nodes()
    # A slow drift that the IMU cannot contradict: a constant velocity of nine metres a round.
    drift = np.array([6.5, -6.0, 1.5]) / round(60 / STEP_S)
    start, steps = chained(true, drift)
    assert worst(start, true) > 9
    batch = Batch(imu, start, NOISE)
    pulled = batch.solve(start, [*steps, *loops(true, 6)])
    found, weights = robust(batch, pulled, steps, loops(true, 6))
    assert weights.min() > OUTLIER
    assert residuals(found, loops(true, 6)).max() < 3
    errors = found.poses[:, :3, 3] - true.poses[:, :3, 3]
    np.testing.assert_allclose(errors[-1] - errors[-1 - round(60 / STEP_S)], 0, atol=0.03)


@pytest.mark.parametrize("offset", [2.0, 9.0])
def test_false_loops_among_true_ones_let_go(imu: Imu, offset: float) -> None:
    true = true_nodes()
    start, steps = chained(true)
    good = loops(true, 6)
    wrong = np.eye(4)
    wrong[:3, 3] = offset, 0.5 * offset, 0.0
    bad = [
        Between(loop.first, loop.second, loop.first_from_second @ wrong, loop.information)
        for loop in good[1::4]
    ]
    batch = Batch(imu, start, NOISE)
    pulled = batch.solve(start, [*steps, *good, *bad])
    found, weights = robust(batch, pulled, steps, [*good, *bad])
    assert weights[: len(good)].min() > OUTLIER > weights[len(good) :].max()
    assert worst(found, true) < 0.2


def test_sigmas_are_those_of_gtsam_where_it_has_any(imu: Imu) -> None:
    start, steps = chained(true_nodes())
    batch = Batch(imu, start, NOISE)
    batch.solve(start, steps)
    sigma = batch.uncertainty([3, 100])
    marginals = gtsam.Marginals(batch._graph, batch._values)
    for row, k in enumerate((3, 100)):
        witness = np.sqrt(np.diag(marginals.marginalCovariance(B(k))))
        np.testing.assert_allclose(sigma.accel_biases[row], witness[:3], rtol=1e-4)
        np.testing.assert_allclose(sigma.gyro_biases[row], witness[3:], rtol=1e-4)
    witness = np.sqrt(np.diag(marginals.marginalCovariance(G(0))))
    np.testing.assert_allclose(sigma.gravity, witness, rtol=1e-4)


def test_the_residual_of_a_relative_pose_is_what_it_is_off_by() -> None:
    true = true_nodes()
    off = np.eye(4)
    off[:3, 3] = 0.03, 0.0, 0.0
    said = np.linalg.inv(true.poses[2]) @ true.poses[7]
    between = Between(2, 7, said @ off, np.eye(6))
    np.testing.assert_allclose(between_error(true, between), [0, 0, 0, -0.03, 0, 0], atol=1e-9)
    assert residuals(true, [between])[0] == pytest.approx(0.03 / np.sqrt(6))


def test_the_g2o_dump_is_read_by_another_program(tmp_path: Path) -> None:
    true = true_nodes()
    _, steps = chained(true)
    path = tmp_path / "graph.g2o"
    path.write_text(write_g2o(true, steps))
    graph, values = gtsam.readG2o(str(path), True)
    assert (graph.size(), values.size()) == (len(steps), len(true.t_ns))
    np.testing.assert_allclose(values.atPose3(9).matrix(), true.poses[9], atol=1e-6)
