"""The blocks of the estimate over a session's drive, against numeric derivatives and gtsam."""

import gtsam
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from session_yard import yard

from card.calibration.drive import plane_kernels as kernels
from card.calibration.drive.inertial import Inertial
from card.calibration.drive.inertial_kernels import UPPER, preintegrate
from card.calibration.drive.state import State, corrections_document, corrections_row
from card.estimation.imu import ImuNoise
from card.estimation.preintegration import INTEGRATION_VARIANCE, parameters
from card.estimation.preintegration import preintegrate as preintegrate_gtsam
from card.geometry.corrections import correct_points

Array = NDArray[np.float64]
NOISE = ImuNoise(1e-4, 1e-3, 1e-6, 2e-5, 1e-3, 0.02)


def _step(size: int, at: int, length: float) -> Array:
    step = np.zeros(size)
    step[at] = length
    return step


def test_state_moves_along_every_parameter_and_back() -> None:
    truth = yard(0, seconds=1.0, columns=3).truth
    rng = np.random.default_rng(0)
    step = 1e-7 * rng.normal(size=truth.columns.size)
    back = truth.moved(step).moved(-step)
    assert np.abs(truth.moved(step).poses - truth.poses).max() > 1e-8
    for name in ("poses", "velocities", "gyro_biases", "accel_biases", "mounted", "corrections"):
        assert np.allclose(getattr(back, name), getattr(truth, name), atol=1e-12), name
    assert np.allclose(back.gyro_matrix, truth.gyro_matrix, atol=1e-12)
    assert np.array_equal(np.tril(truth.moved(step).accel_matrix, -1), np.zeros((3, 3)))


def test_corrections_are_the_same_in_a_document() -> None:
    row = np.random.default_rng(0).normal(size=kernels.CORRECTIONS)
    assert np.array_equal(corrections_row(corrections_document(row)), row)


def test_derivatives_of_a_return_are_numeric_ones() -> None:
    scene = yard(1, seconds=1.0, columns=3)
    truth, rays = scene.truth, scene.rays
    at = truth.columns
    rng = np.random.default_rng(0)
    for n in rng.choice(np.flatnonzero(rays.time_ns > truth.t_ns[1]), 12):
        lidar, ring = int(rays.lidar[n]), int(rays.ring[n])
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)

        def off(state: State, n: int = n, lidar: int = lidar, normal: Array = normal) -> float:
            """Along the normal, for a rig that stands at the first knot: a share of 0 for the second one."""
            row = corrections_document(state.corrections[lidar])
            point = correct_points(rays.points[n : n + 1], rays.ring[n : n + 1], row)[0]
            q = state.mounted[lidar, :3, :3] @ point + state.mounted[lidar, :3, 3]
            return float(normal @ (state.poses[0, :3, :3] @ q + state.poses[0, :3, 3]))

        document = corrections_document(truth.corrections[lidar])
        point = correct_points(rays.points[n : n + 1], rays.ring[n : n + 1], document)[0]
        J, columns = np.empty(kernels.NONZERO), np.empty(kernels.NONZERO, np.int64)
        places = np.array(
            [0, 6, at.mountings + 6 * lidar, at.corrections + kernels.CORRECTIONS * lidar], dtype=np.int64
        )
        kernels.derivatives(
            point, truth.poses[0, :3], truth.mounted[lidar], normal, ring, places, 0.25, columns, J
        )
        for column, value in zip(columns, J, strict=True):
            if column < at.mountings:
                continue
            h = 1e-6
            numeric = off(truth.moved(_step(at.size, column, h))) - off(
                truth.moved(_step(at.size, column, -h))
            )
            assert value == pytest.approx(numeric / (2 * h), abs=2e-6 * np.linalg.norm(point)), column
        for k in range(6):
            h = 1e-6
            numeric = off(truth.moved(_step(at.size, k, h))) - off(truth.moved(_step(at.size, k, -h)))
            assert J[k] == pytest.approx(0.75 * numeric / (2 * h), abs=2e-6 * np.linalg.norm(point))
            assert J[6 + k] == pytest.approx(J[k] / 3)


def test_derivatives_of_the_imu_are_numeric_ones() -> None:
    scene = yard(2, seconds=2.0, columns=3)
    truth = scene.truth
    inertial = Inertial(scene.imu, truth.t_ns, NOISE, 9.81)
    residual, J, columns, _ = inertial.residual(truth, 1)
    assert np.abs(residual[:3]).max() < 5e-3
    for column, derivative in zip(columns, J.T, strict=True):
        h = 1e-5
        plus = inertial.residual(truth.moved(_step(truth.columns.size, column, h)), 1)[0]
        minus = inertial.residual(truth.moved(_step(truth.columns.size, column, -h)), 1)[0]
        numeric = (plus - minus) / (2 * h)
        # The rotation's own right Jacobian is left out: it differs from one by what the residual is.
        assert np.allclose(derivative, numeric, atol=3e-3 * max(1.0, np.abs(numeric).max())), column


def test_preintegration_is_that_of_gtsam() -> None:
    scene = yard(3, seconds=1.0, columns=3)
    part = scene.imu.between(int(scene.imu.t_ns[10]), int(scene.imu.t_ns[60]))
    bias = np.array([1e-3, -2e-3, 5e-4]), np.array([0.02, -0.01, 0.03])
    seconds = (part.t_ns - part.t_ns[0]) * 1e-9
    turn, faster, farther, _, covariance = preintegrate(
        seconds, part.gyro, part.accel, *bias, np.eye(3), np.eye(3), 1e-4, 1e-3, INTEGRATION_VARIANCE
    )
    theirs = preintegrate_gtsam(part, parameters(NOISE, 9.81), gtsam.imuBias.ConstantBias(bias[1], bias[0]))
    # Theirs integrates in a tangent space, which costs it some 1e-7 rad.
    assert np.abs(Rotation.from_matrix(turn.T @ theirs.deltaRij().matrix()).as_rotvec()).max() < 1e-6
    assert np.allclose(faster, theirs.deltaVij(), atol=1e-6)
    assert np.allclose(farther, theirs.deltaPij(), atol=1e-6)
    # Rotation, position, velocity in both; theirs also lets the bias walk within the interval.
    ratio = np.sqrt(np.diag(covariance) / np.diag(theirs.preintMeasCov())[:9])
    assert np.all((ratio > 0.9) & (ratio < 1.1)), ratio


def test_triangles_are_upper_ones() -> None:
    assert tuple((i, j) for i in range(3) for j in range(i, 3)) == UPPER
