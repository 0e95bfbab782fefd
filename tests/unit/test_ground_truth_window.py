import numpy as np
import pytest

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
