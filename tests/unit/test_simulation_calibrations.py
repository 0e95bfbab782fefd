"""True and delivered calibrations of the sessions of a day."""

import numpy as np
import pytest

from card.artifacts import check
from card.errors import CardError
from card.geometry import from_json
from card.simulation.calibrations import delivered_calibration, true_calibration
from card.simulation.rig import built_rig, nominal_rig

START, MID = "2026-04-14-start", "2026-04-14-mid"
SENSORS = ("camera_left", "camera_right", "lidar_front", "lidar_rear")


def _offset(a: dict, b: dict, sensor: str) -> np.ndarray:
    """`_step` between two bundles' poses of a sensor in the rig."""
    return _step(*(from_json(c["extrinsics"][f"rig_from_{sensor}"]) for c in (a, b)))


def _step(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Translation (m) and rotation vector (rad) from one pose (4, 4) to another, in their target frame."""
    turn = other[:3, :3] @ one[:3, :3].T
    skew = 0.5 * (turn - turn.T)
    return np.concatenate([other[:3, 3] - one[:3, 3], [skew[2, 1], skew[0, 2], skew[1, 0]]])


@pytest.mark.parametrize("make", [true_calibration, lambda *a: delivered_calibration(*a, views=12)])
def test_documents_fit_the_schema_and_repeat(make) -> None:
    document = make(START, 3, "tiny")
    check(document, "calibration", "calibration")
    assert document == make(START, 3, "tiny")
    assert document != make(START, 4, "tiny")


def test_the_car_differs_from_its_drawing_and_drifts_far_less_between_sessions() -> None:
    start, mid = true_calibration(START, 0, "demo"), true_calibration(MID, 0, "demo")
    drawn = nominal_rig(562, 563)
    for sensor in SENSORS:
        drift = _offset(start, mid, sensor)
        built = from_json(start["extrinsics"][f"rig_from_{sensor}"])[:3, 3] - drawn.rig_from[sensor][:3, 3]
        assert 0 < np.abs(drift[:3]).max() < 6e-4
        assert 0 < np.abs(drift[3:]).max() < np.radians(0.015)
        assert np.abs(built).max() > np.abs(drift[:3]).max()
    assert start["wheels"] == mid["wheels"]


def test_the_errors_of_deliveries_have_the_covariance_they_state() -> None:
    seeds = range(120)
    truths = [true_calibration(START, seed, "tiny") for seed in seeds]
    given = [delivered_calibration(START, seed, "tiny", views=3) for seed in seeds]
    for sensor in SENSORS:
        squares = []
        for truth, bundle in zip(truths, given, strict=True):
            error = _offset(truth, bundle, sensor)
            squares.append(error @ np.linalg.solve(bundle["covariances"][f"rig_from_{sensor}"], error))
        # Mean of 120 chi-squares with 6 degrees of freedom: 6 +- 4 standard errors.
        assert np.mean(squares) == pytest.approx(6, abs=4 * np.sqrt(12 / 120)), sensor


def test_the_imu_is_undone_by_its_corrections_which_a_delivery_has_nearly_right() -> None:
    errors = []
    for seed in range(60):
        unit = built_rig(START[:10], seed, 80, 80).imu
        truth = true_calibration(START, seed, "tiny")["imu_corrections"]
        given = delivered_calibration(START, seed, "tiny", views=3)["imu_corrections"]
        for name in ("gyro", "accel"):
            np.testing.assert_allclose(np.array(truth[name]) @ getattr(unit, name), np.eye(3), atol=1e-12)
            assert not np.tril(given[name], -1).any()
        errors.append([np.subtract(given[name], truth[name]) for name in ("gyro", "accel")])
    sigma = np.sqrt(np.mean(np.square(errors), axis=0))
    assert sigma[0, 2, 2] == pytest.approx(6e-5, rel=0.4)
    assert sigma[1, 2, 2] == pytest.approx(7e-4, rel=0.4)


@pytest.mark.parametrize(
    ("sensor", "against", "sigma_rad", "sigma_m"),
    [
        ("camera_left", "lidar_front", np.radians(0.0075), 3e-4),
        ("lidar_rear", "lidar_front", np.radians(0.004), 1.5e-4),
        ("camera_right", "camera_left", np.radians(0.003), 3e-4),
    ],
)
def test_sensors_err_less_against_each_other_than_against_the_rig(
    sensor: str, against: str, sigma_rad: float, sigma_m: float
) -> None:
    errors = []
    for seed in range(120):
        truth, given = (
            true_calibration(START, seed, "tiny"),
            delivered_calibration(START, seed, "tiny", views=3),
        )
        one, other = (
            {name: from_json(bundle["extrinsics"][f"rig_from_{name}"]) for name in (sensor, against)}
            for bundle in (truth, given)
        )
        carried = other[against] @ np.linalg.inv(one[against]) @ one[sensor]
        errors.append(_step(carried, other[sensor]))
    rms = np.sqrt(np.mean(np.square(np.array(errors).reshape(-1, 2, 3)), axis=(0, 2)))
    assert rms == pytest.approx([sigma_m, sigma_rad], rel=0.2)


def test_a_name_that_is_no_session_is_refused() -> None:
    with pytest.raises(CardError, match=r"not a session \(found 2026-04-14-leica, wanted <day>-start"):
        true_calibration("2026-04-14-leica", 0, "tiny")
