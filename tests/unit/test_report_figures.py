"""What the report's figures show, as numbers."""

import numpy as np
import pytest

from card.report.excitation import Contact, excitation, passed
from card.report.labels import coverage
from card.report.map import highest_in_cells
from card.report.numbers import distance, duration, number, size


def test_excitation_keeps_a_bump_and_takes_out_a_slope() -> None:
    y = np.arange(0, 100, 0.03)
    bump = 0.05 * np.exp(-(((y - 50) / 0.3) ** 2))
    contact = Contact(np.stack([0 * y, y, 0.06 * y + bump], axis=1), np.zeros(y.size, dtype=bool), 1.5)
    at, height = excitation(contact)
    assert at[np.argmax(height)] == pytest.approx(51.5, abs=0.06)
    assert height.max() == pytest.approx(0.05, abs=0.004)
    level = np.abs(at - 51.5) > 6
    assert np.abs(height[level]).max() < 1e-8


def test_excitation_is_blank_in_gaps_and_stands_still_with_the_car() -> None:
    y = np.concatenate([np.linspace(0, 20, 400), np.full(100, 20.0), np.linspace(20, 40, 400)])
    contact = Contact(np.stack([y, 0 * y, 0 * y], axis=1), (y > 30) & (y < 33), 0.0)
    at, height = excitation(contact)
    assert at[-1] == pytest.approx(40, abs=0.05)
    blank = at[np.isnan(height)]
    assert blank.min() == pytest.approx(30, abs=0.1)
    assert blank.max() == pytest.approx(33, abs=0.1)


def test_the_map_shows_the_highest_voxel_of_a_cell() -> None:
    voxels = np.array([[0.1, 0.1, 1.0], [0.2, 0.3, 5.0], [1.6, 0.2, -2.0], [9.0, 9.0, 1.0]])
    top = highest_in_cells(voxels, np.zeros(2), 0.5, (2, 4))
    np.testing.assert_array_equal(top, [[5.0, np.nan, np.nan, -2.0], [np.nan] * 4])


def test_the_heat_map_counts_the_boxes_over_each_cell() -> None:
    edges = np.array([[0.0, 0.0, 0.5, 1.0], [0.25, 0.5, 1.0, 1.0]])
    np.testing.assert_array_equal(coverage(edges, (2, 4)), [[1, 1, 0, 0], [1, 2, 1, 1]])


def test_numbers_read_well() -> None:
    assert [number(v) for v in (None, 0, 3.0, 1234567, 0.12345, 98765.4321, 0.00001)] == [
        "–",
        "0",
        "3",
        "1,234,567",
        "0.1235",
        "98,765",
        "1.0e-05",
    ]
    assert [size(v) for v in (12, 3_400_000, 2_000_000_000_000_000)] == ["12 B", "3.4 MB", "2e+03 TB"]
    assert [duration(v) for v in (45, 720, 17_000)] == ["45 s", "12 min", "4.7 h"]
    assert [distance(v) for v in (480, 12_345)] == ["480 m", "12.3 km"]


def test_labels_stand_where_the_car_passes_them() -> None:
    """Out along y for 40 m and back beside it: a label ahead is passed twice, one far off never."""
    out = np.stack([np.zeros(81), np.arange(81) / 2, np.zeros(81)], axis=1)
    track = np.concatenate([out, out[::-1] + np.array([1.0, 0, 0])])
    left, right = (
        Contact(track + np.array([x, 0, 0]), np.zeros(len(track), dtype=bool), 0.7) for x in (-0.8, 0.8)
    )
    places = np.array([[0.5, 12.0, 0], [30.0, 12.0, 0]])
    np.testing.assert_allclose(
        passed({"fl": left, "fr": right}, places), [12.7, 40 + 1 + 28 + 0.7], atol=0.01
    )
