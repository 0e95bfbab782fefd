"""Places known again by their look from above."""

import sys

import numpy as np
import pytest

from card.artifacts import default_settings
from card.errors import CardError
from card.geometry import apply, inverse, transform
from card.poses.appearance import returns

SETTINGS = default_settings("pose_graph")
LEG_M, STEP_M, DRIFT_M = 60.0, 2.0, np.array([9.0, -6.0, 0.0])


@pytest.fixture(scope="module")
def rounds() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two rounds of a square: true poses (N, 4, 4), those with a drift in the second, points (P, 3)."""
    corners = LEG_M * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    along = np.arange(0, 8 * LEG_M, STEP_M)
    leg, rest = np.divmod(along, LEG_M)
    heading = np.radians(90) * leg
    start = corners[leg.astype(int) % 4]
    place = start + rest[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    true = np.stack(
        [
            transform(np.array([*xy, 1.0]), np.array([np.cos(a / 2), 0, 0, np.sin(a / 2)]))
            for xy, a in zip(place, heading, strict=True)
        ]
    )
    drifted = true.copy()
    drifted[along > 4 * LEG_M, :3, 3] += DRIFT_M
    rng = np.random.default_rng(5)
    ground = np.column_stack([rng.uniform(-40, 100, (60_000, 2)), np.zeros(60_000)])
    houses = []
    for center in rng.uniform(-35, 95, (220, 2)):
        if np.abs(place - center).max(axis=1).min() > 6:
            wall = rng.uniform(-1, 1, (400, 2)) * rng.uniform(1, 5, 2)
            wall[np.arange(400), rng.integers(0, 2, 400)] = 3.0
            houses.append(np.column_stack([wall + center, rng.uniform(0, 6, 400)]))
    return true, drifted, np.concatenate([ground, *houses])


def sweep_of(true: np.ndarray, world: np.ndarray):
    def points(k: int) -> np.ndarray:
        own = apply(inverse(true[k]), world)
        return own[np.linalg.norm(own, axis=1) < 35]

    return points


def test_a_round_is_known_again_whatever_has_drifted(rounds):
    true, drifted, world = rounds
    found = returns(drifted, sweep_of(true, world), SETTINGS)
    half = len(true) // 2
    assert any(earlier < half < later for earlier, later, _ in found)
    for earlier, later, guess in found:
        assert np.linalg.norm((inverse(true[later]) @ true[earlier] @ guess)[:3, 3]) < 1.0


def test_new_places_are_not_known(rounds):
    true, _, world = rounds
    once = true[: round(3 * LEG_M / STEP_M)]
    assert returns(once, sweep_of(once, world), SETTINGS) == []


def test_without_the_package_the_setting_is_refused(rounds, monkeypatch):
    true, _, world = rounds
    monkeypatch.setitem(sys.modules, "map_closures.map_closures", None)
    with pytest.raises(CardError, match="loops by appearance without the package map-closures"):
        returns(true, sweep_of(true, world), SETTINGS)
