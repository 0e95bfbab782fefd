from types import SimpleNamespace

import numpy as np
import pytest

from card.artifacts import default_settings
from card.ground_truth.coverage import frame_window
from card.ground_truth.window import covered_share, overlapping, window_ns


def test_bounds_in_nanoseconds():
    assert window_ns(5_000_000_000, (-3, 13)) == (2_000_000_000, 18_000_000_000)


def test_overlap_is_closed_on_both_sides():
    start = np.array([0, 100, 200, 300])
    end = np.array([100, 199, 299, 399])
    assert overlapping(start, end, 100, 200).tolist() == [0, 1, 2]
    assert overlapping(start, end, 101, 199).tolist() == [1]
    assert overlapping(start, end, 400, 500).tolist() == []


@pytest.mark.parametrize(
    ("low", "high", "share"),
    [(0, 1000, 1.0), (-1000, 1000, 0.5), (500, 1500, 0.5), (2000, 3000, 0.0), (250, 260, 1.0)],
)
def test_share_of_a_window_cut_at_the_ends(low, high, share):
    assert covered_share(np.arange(0, 1000, 100), low, high) == pytest.approx(share)


def test_silence_counts_as_missing_and_overlaps_do_not_count_twice():
    start = np.r_[np.arange(0, 500, 100), np.arange(800, 1300, 100)]
    assert covered_share(start, 0, 1000) == pytest.approx(0.7)
    assert covered_share(np.array([0, 90, 190, 290]), 0, 390) == pytest.approx(1.0)


def test_a_lidar_without_bursts_covers_nothing():
    assert covered_share(np.empty(0, np.int64), 0, 10) == 0.0


class Bursts(SimpleNamespace):
    """Bursts of a minute, 10 Hz, but for those of one LiDAR that begin within the silence."""

    def __init__(self, front_is_silent, low_s, high_s):
        start = np.repeat(np.arange(600) * 100_000_000, 2)
        front = np.tile([True, False], 600)
        silent = (front == front_is_silent) & (start >= low_s * 1e9) & (start < high_s * 1e9)
        start, front = start[~silent], front[~silent]
        super().__init__(start_ns=start, end_ns=start + 99_000_000, front=front)

    def of(self, front):
        return np.flatnonzero(self.front == front)


@pytest.mark.parametrize(
    ("silence", "flag"),
    [
        ((True, 0, 0), "complete"),
        ((True, 12, 13.5), "cut"),
        ((False, 20, 22), "cut"),
        ((False, 20, 21), "complete"),
        ((False, 9, 45), "no_rear"),
        ((True, 5, 25), "no_front"),
    ],
)
def test_a_lidar_that_falls_silent_flags_the_frame(silence, flag):
    window = frame_window(Bursts(*silence), 10_000_000_000, True, default_settings("ground_truth"))
    assert window.columns["flag"] == flag


@pytest.mark.parametrize(
    ("t_s", "flag"), [(2.0, "cut"), (2.5, "complete"), (30.0, "complete"), (32.0, "cut")]
)
def test_windows_cut_at_the_ends_flag_the_frame(t_s, flag):
    window = frame_window(Bursts(True, 0, 0), round(t_s * 1e9), True, default_settings("ground_truth"))
    assert window.columns["flag"] == flag
