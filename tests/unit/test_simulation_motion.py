"""The car's body on its springs, and an IMU that agrees with the path."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from card.geometry import Trajectory, matrix_from_quaternion
from card.simulation.centreline import winding
from card.simulation.drives import TOWN
from card.simulation.imu import GRAVITY_M_S2, RATE_HZ, ImuErrors, ideal_imu, imu_times, measured_imu
from card.simulation.irregularities import Bump
from card.simulation.rig import RIG_HEIGHT_M, ImuUnit
from card.simulation.road import Road, hills
from card.simulation.spectrum import roughness
from card.simulation.suspension import HEAVE, QuarterCar, sprung
from card.simulation.vehicle import Lane, course, ride


@pytest.fixture(scope="module")
def trip():  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(7)
    line = winding(160.0, -40.0, 0.015, rng)
    bump = Bump(20.0, -3.0, 3.0, 1.5, 0.06)
    road = Road(line, TOWN, hills(rng), roughness("B", rng), (bump,), np.eye(4))
    where = course([(0, 6.0), (3, 7.0), (6, 2.0), (8, 0.0)], 0.0, 8.0)
    return road, where, ride(road, Lane(1.75, 0.1, 60.0, 0.3), where, 1_000_000_000)


@pytest.mark.parametrize("hz", [0.5, 1.3, 3.0, 8.0])
def test_body_answers_a_sine_as_a_quarter_car(hz: float) -> None:
    mode, rate = QuarterCar(1.3, 0.35), 1000
    t = np.arange(0, 12, 1 / rate)
    body = sprung(np.sin(2 * np.pi * hz * t), mode, 1 / rate)
    # Two masses written out as equations of motion, solved for a harmonic.
    w, ks = 2 * np.pi * hz, (2 * np.pi * mode.body_hz) ** 2
    spring = ks + 1j * w * 2 * mode.damping * 2 * np.pi * mode.body_hz
    tyre = (2 * np.pi * mode.tyre_hz) ** 2
    system = np.array([[-(w**2) + spring, -spring], [-spring, -mode.mass_ratio * w**2 + spring + tyre]])
    wanted = abs(np.linalg.solve(system, [0, tyre])[0])
    late = t > 8
    basis = np.column_stack([np.sin(2 * np.pi * hz * t[late]), np.cos(2 * np.pi * hz * t[late])])
    found = np.linalg.norm(np.linalg.lstsq(basis, body[late], rcond=None)[0])
    assert found == pytest.approx(wanted, rel=0.01)


def test_body_does_not_follow_the_wheels() -> None:
    t = np.arange(0, 3, 1e-3)
    ground = 0.06 * ((t > 1.0) & (t < 1.05))  # 40 cm of bump at 8 m/s
    body = sprung(ground, HEAVE, 1e-3)
    assert 0.002 < body.max() < 0.5 * ground.max()
    assert abs(body[-1]) < 0.002


def test_rig_rides_at_its_height_and_stops(trip) -> None:  # type: ignore[no-untyped-def]
    road, where, path = trip
    position = path.translation_m
    ground = road.height(position[:, :2], where.s)
    assert np.abs(position[:, 2] - ground - RIG_HEIGHT_M).max() < 0.12
    np.testing.assert_allclose(np.median(position[:, 2] - ground), RIG_HEIGHT_M, atol=0.04)
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) * 1000
    assert speed.max() < 8
    assert speed[-1000:].max() < 0.05


def test_imu_integrates_back_to_the_path(trip) -> None:  # type: ignore[no-untyped-def]
    _, _, path = trip
    times = imu_times(1_000_000_000, 8.0)
    rate, force = ideal_imu(path, times)
    truth = path.at(times)
    step = 1 / RATE_HZ
    rotation = truth[0, :3, :3]
    velocity = (path.at(times[0] + 1_000_000)[:3, 3] - path.at(times[0] - 1_000_000)[:3, 3]) / 0.002
    position = truth[0, :3, 3].copy()
    gravity = np.array([0, 0, -GRAVITY_M_S2])
    for k in range(len(times) - 1):
        turn = Rotation.from_rotvec((rate[k] + rate[k + 1]) / 2 * step).as_matrix()
        after = rotation @ turn
        acceleration = (rotation @ force[k] + after @ force[k + 1]) / 2 + gravity
        position += velocity * step + acceleration * step**2 / 2
        velocity += acceleration * step
        rotation = after
    tilt = Rotation.from_matrix(rotation.T @ truth[-1, :3, :3]).magnitude()
    assert np.linalg.norm(position - truth[-1, :3, 3]) < 0.03
    assert np.degrees(tilt) < 0.02


def test_imu_at_rest_measures_gravity_upwards(trip) -> None:  # type: ignore[no-untyped-def]
    _, _, path = trip
    t_ns = np.array([10_900_000_000])
    rate, force = ideal_imu(path, t_ns)
    up = matrix_from_quaternion(path.rotation_wxyz[-1])[2]
    np.testing.assert_allclose(force[0], GRAVITY_M_S2 * up, atol=0.15)
    assert np.abs(rate).max() < 0.02


def test_imu_noise_has_its_density(trip) -> None:  # type: ignore[no-untyped-def]
    _, _, path = trip
    times = imu_times(1_000_000_000, 8.0)
    errors = ImuErrors(gyro_bias=0.0, accel_bias=0.0, gyro_walk=0.0, accel_walk=0.0)
    table = measured_imu(path, times, errors, ImuUnit(), np.random.default_rng(0))
    rate, force = ideal_imu(path, times)
    for name, true, density in (("gyro", rate, errors.gyro_noise), ("accel", force, errors.accel_noise)):
        noise = np.column_stack([table[f"{name}_{axis}"] for axis in "xyz"]) - true
        assert noise.std() == pytest.approx(density * np.sqrt(RATE_HZ), rel=0.05)


def test_scale_and_skew_of_the_unit_come_out_of_a_fit(trip) -> None:  # type: ignore[no-untyped-def]
    _, _, path = trip
    times = imu_times(1_000_000_000, 8.0)
    unit = ImuUnit(
        np.array([[1.002, 0.001, -0.0005], [0, 0.999, 0.0008], [0, 0, 1.001]]),
        np.array([[0.998, 0.0004, 0.001], [0, 1.003, -0.0006], [0, 0, 1.0005]]),
    )
    silent = ImuErrors(*[0.0] * 6)
    table = measured_imu(path, times, silent, unit, np.random.default_rng(0))
    rate, force = ideal_imu(path, times)
    for name, true, matrix in (("gyro", rate, unit.gyro), ("accel", force, unit.accel)):
        measured = np.column_stack([table[f"{name}_{axis}"] for axis in "xyz"])
        fitted = np.linalg.lstsq(true, measured, rcond=None)[0].T
        np.testing.assert_allclose(fitted, matrix, atol=1e-6)


@pytest.mark.parametrize("walks", [False, True])
def test_allan_deviation_falls_with_noise_and_rises_with_the_walk(walks: bool) -> None:
    seconds = np.arange(-2.0, 1503.0)
    t_ns = np.round(seconds * 1e9).astype(np.int64)
    path = Trajectory(t_ns, np.zeros((len(t_ns), 3)), np.tile([1.0, 0, 0, 0], (len(t_ns), 1)))
    density, walk = 1e-4, 3e-5
    errors = ImuErrors(gyro_noise=0.0 if walks else density, gyro_walk=walk if walks else 0.0)
    times = imu_times(0, 1500.0)
    table = measured_imu(path, times, errors, ImuUnit(), np.random.default_rng(4))
    rate = np.column_stack([table[f"gyro_{axis}"] for axis in "xyz"])
    for tau in (1.0, 4.0, 16.0):
        length = round(tau * RATE_HZ)
        means = rate[: len(rate) // length * length].reshape(-1, length, 3).mean(axis=1)
        allan = np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2))
        # IEEE Std 952, annex C: N / sqrt(tau) of white noise, K sqrt(tau / 3) of a random walk.
        wanted = walk * np.sqrt(tau / 3) if walks else density / np.sqrt(tau)
        assert allan == pytest.approx(wanted, rel=3.5 / np.sqrt(2 * means.size))
