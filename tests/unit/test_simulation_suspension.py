"""The body on its springs against closed forms: each mode, air at its height, loads, a road of one wave."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from card.simulation.centreline import CentreLine
from card.simulation.drives import FURTHER_DRIVES, RURAL
from card.simulation.footprint import FOOTPRINT_M
from card.simulation.rig import FRONT_AXLE_Y_M, REAR_AXLE_Y_M, RIG_HEIGHT_M
from card.simulation.road import Hills, Road
from card.simulation.spectrum import Roughness
from card.simulation.suspension import (
    HEAVE,
    LEVELLING_S,
    MASS_KG,
    PITCH,
    ROLL,
    QuarterCar,
    levelled,
    sag,
    sprung,
)
from card.simulation.vehicle import Lane, Load, course, ride

Array = NDArray[np.float64]
STEP_S = 1e-3
FLAT = Hills(np.zeros(0), np.zeros((0, 2)), np.zeros(0))
SMOOTH = Roughness(*np.zeros((4, 0)))
STRAIGHT_ON = Lane(1.45, 0.0, 60.0, 0.0)


def response(mode: QuarterCar, hz: float) -> complex:
    """Body over ground of two masses on springs, their equations of motion solved for a harmonic."""
    w, stiffness = 2 * np.pi * hz, (2 * np.pi * mode.body_hz) ** 2
    spring = stiffness + 1j * w * 2 * mode.damping * 2 * np.pi * mode.body_hz
    tyre = (2 * np.pi * mode.tyre_hz) ** 2
    system = np.array([[-(w**2) + spring, -spring], [-spring, -mode.mass_ratio * w**2 + spring + tyre]])
    return complex(np.linalg.solve(system, [0, tyre])[0])


def amplitude(value: Array, t: Array, hz: float) -> complex:
    basis = np.column_stack([np.cos(2 * np.pi * hz * t), -np.sin(2 * np.pi * hz * t), np.ones(len(t))])
    real, imaginary, _ = np.linalg.lstsq(basis, value, rcond=None)[0]
    return complex(real, imaginary)


@pytest.mark.parametrize("mode", [HEAVE, PITCH, ROLL])
@pytest.mark.parametrize("hz", [0.3, 1.0, 1.5, 2.5, 6.0, 11.0])
def test_each_mode_has_its_transfer_function(mode: QuarterCar, hz: float) -> None:
    t = np.arange(0, 16, STEP_S)
    body = sprung(np.sin(2 * np.pi * hz * t), mode, STEP_S)
    late = t > 16 - 4 / 0.3 / 2
    found = amplitude(body[late], t[late], hz)
    wanted = response(mode, hz) * -1j  # of a sine
    assert abs(found - wanted) < 0.01 * max(abs(wanted), 0.05)


def test_the_body_s_own_frequency_is_that_of_its_mode() -> None:
    hz = np.linspace(0.3, 3.0, 200)
    for mode in (HEAVE, PITCH, ROLL):
        gain = [abs(response(mode, f)) for f in hz]
        assert hz[int(np.argmax(gain))] == pytest.approx(mode.body_hz, rel=0.2)
        assert abs(response(mode, 8.0)) < 0.15


def test_a_load_s_sag_is_gone_after_the_levelling_time() -> None:
    t = np.arange(0, 60, STEP_S)
    left = levelled(np.where(t >= 1.0, -0.006, 0.0), STEP_S)
    after = t >= 1.0
    np.testing.assert_allclose(left[after], -0.006 * np.exp(-(t[after] - 1.0) / LEVELLING_S), atol=2e-6)
    assert abs(left[-1]) < 2e-5
    slow = levelled(1e-5 * t, STEP_S)  # what changes steadily leaves rate times time constant
    assert slow[-1] == pytest.approx(1e-5 * LEVELLING_S * (1 - np.exp(-60 / LEVELLING_S)), rel=1e-3)


def test_a_standing_car_sinks_under_a_load_and_comes_back_to_its_height() -> None:
    road = Road(CentreLine(np.zeros(240)), replace(RURAL, bank=0.0), FLAT, SMOOTH, (), np.eye(4))
    where = course([(0, 0.0), (60, 0.0)], 40.0, 56.0)
    empty = ride(road, STRAIGHT_ON, where, 0)
    loaded = ride(road, STRAIGHT_ON, where, 0, (Load(5.0, 100.0, 0.0, -0.7),))
    sunk = loaded.translation_m[:, 2] - empty.translation_m[:, 2]
    assert np.ptp(empty.translation_m[:, 2]) < 1e-6
    heave = -100 * 9.81 / (MASS_KG * (2 * np.pi * HEAVE.body_hz) ** 2)
    assert sag(100.0, 0.0, -0.7) == pytest.approx((heave, 0.0, 0.0))
    assert sunk.min() == pytest.approx(heave, rel=0.1)
    for seconds in (10.0, 20.0):
        at = np.argmin(abs(where.t - 5.75 - seconds))  # it takes 1.5 s to get in
        assert sunk[at] == pytest.approx(heave * np.exp(-seconds / LEVELLING_S), rel=0.05)
    assert abs(sunk[-1]) < 0.02 * abs(heave)
    assert FURTHER_DRIVES["de_town_slow"].loads


@pytest.mark.parametrize("wavelength", [3.0, 7.0, 16.0])
def test_a_road_of_one_wave_moves_the_rig_as_its_modes_say(wavelength: float) -> None:
    speed, size = 6.0, 0.01
    k = 2 * np.pi / wavelength
    wave = Roughness(np.array([size]), np.array([k]), np.zeros(1), np.zeros(1))
    road = Road(CentreLine(np.zeros(600)), replace(RURAL, bank=0.0), FLAT, wave, (), np.eye(4))
    where = course([(0, speed), (60, speed)], 20.0, 36.0)
    path = ride(road, STRAIGHT_ON, where, 0)
    hz = speed / wavelength
    late = where.t > 36 - np.floor(18 * hz) / hz
    t = where.t[late]
    start = where.s[late][0] - speed * t[0]
    # Both axles see the wave, damped by the footprint, at their own places; height is the line's at y = 0.
    damped = size * np.sinc(k * FOOTPRINT_M[0] / 2 / np.pi) * np.exp(1j * k * start)
    front, rear = (damped * np.exp(1j * k * y) for y in (FRONT_AXLE_Y_M, REAR_AXLE_Y_M))
    slope = (front - rear) / (FRONT_AXLE_Y_M - REAR_AXLE_Y_M)
    height = front - slope * FRONT_AXLE_Y_M
    found = amplitude(path.translation_m[late, 2], t, hz)
    assert abs(found - height * response(HEAVE, hz)) < 0.02 * size
    forward = path.at(path.t_ns[late])[:, :3, 1]
    pitch = amplitude(forward[:, 2] / forward[:, 1], t, hz)
    # Gravity on the slope leans a little more: 0.004 rad per m/s^2, which the air takes back below 0.1 Hz.
    assert abs(pitch - slope * response(PITCH, hz) * (1 + 0.004 * 9.81)) < 0.01 * abs(slope)
    assert path.translation_m[late, 2].mean() - road.bare([0.0], [1.45])[0, 2] == pytest.approx(
        RIG_HEIGHT_M, abs=0.05
    )
