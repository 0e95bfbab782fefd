"""From a sensor's clock to the host's."""

import numpy as np
import pytest

from card.recording.clock import fit_clock

SENSOR_NS = 1_564_024_769_000_000_000
OFFSET_NS = 109_375_908_081_000_000


def stamps(seconds: float, skew: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sensor stamps at 250 Hz, their true times on the host, and the host's late stamps."""
    rng = np.random.default_rng(seed)
    since = np.arange(0, int(seconds * 1e9), 4_000_000)
    true = SENSOR_NS + OFFSET_NS + since + np.rint(since * skew).astype(np.int64)
    return SENSOR_NS + since, true, true + rng.exponential(150_000, len(since)).astype(np.int64)


@pytest.mark.parametrize("skew", [0.0, 20e-6, -80e-6])
def test_a_drifting_clock_is_followed(skew: float) -> None:
    sensor, true, late = stamps(120, skew)
    clock = fit_clock(sensor, late)
    assert clock.skew == pytest.approx(skew, abs=0.2e-6)
    error = clock.to_host(sensor) - true
    # Never later than the truth by more than the least delay met, a few microseconds of 150 us.
    assert np.abs(error).max() < 15_000
    assert clock.delay_ns == pytest.approx(150_000 * np.log(2), rel=0.1)


def test_no_host_stamp_lies_before_the_line() -> None:
    sensor, _, late = stamps(60, 30e-6, seed=5)
    assert (late - fit_clock(sensor, late).to_host(sensor)).min() >= -1


def test_a_short_recording_gets_an_offset_alone() -> None:
    sensor, _, late = stamps(0.4, 0.0)
    clock = fit_clock(sensor, late)
    assert clock.skew == 0.0
    assert clock.offset_ns == (late - sensor).min()
    np.testing.assert_array_equal(clock.to_host(sensor), sensor + clock.offset_ns)


def test_stamps_that_repeat_do_no_harm() -> None:
    sensor, true, late = stamps(60, 10e-6)
    clock = fit_clock(np.repeat(sensor, 2), np.repeat(late, 2))
    assert np.abs(clock.to_host(sensor) - true).max() < 15_000
