"""Which samples of a wheel are uncertain: where points are sparse or disagree, not for a speck of dust."""

import numpy as np
from numpy.typing import NDArray

from card.artifacts import default_settings
from card.geometry import Trajectory
from card.wheels.arc_height import RoadPoints
from card.wheels.contact_path import contact_path
from card.wheels.profile import SplineSettings
from card.wheels.wheel_fit import Excitation, QualitySettings, fit_excitation

Array = NDArray[np.float64]
STEP_M = 0.04


def excitation(arc: Array, height: Array) -> tuple[Array, Excitation]:
    """Arc lengths and excitation of a wheel that rolls 40 m straight on over points (N,)."""
    y = np.arange(0, 40, STEP_M)
    level = np.tile([1.0, 0, 0, 0], (len(y), 1))
    position = np.stack([np.zeros_like(y), y, np.full_like(y, 1.7)], axis=1)
    path = contact_path(Trajectory(np.arange(len(y)) * 10_000_000, position, level), [0.8, 0.0, -1.7], 0.05)
    settings = default_settings("wheels")
    spline = SplineSettings(**{name: settings[name] for name in SplineSettings.__dataclass_fields__})
    quality = QualitySettings(**{name: settings[name] for name in QualitySettings.__dataclass_fields__})
    sideways = np.random.default_rng(1).uniform(-0.1, 0.1, len(arc))
    road = RoadPoints(arc, sideways, height, np.zeros(len(arc), dtype=np.int64))
    return path.arc, fit_excitation(path, road, spline, quality, settings["footprint_m"])


def test_points_that_are_sparse_or_disagree_are_uncertain_and_dust_is_not() -> None:
    rng = np.random.default_rng(2)
    arc = np.concatenate([rng.uniform(0, 40, 9600), np.arange(30.0, 33, 0.18).repeat(40)])
    arc = arc[~((arc > 30) & (arc < 33)) | (np.arange(len(arc)) >= 9600)]
    height = rng.normal(0, 0.0017, len(arc))
    dust = (arc > 5) & (arc < 10) & (rng.uniform(size=len(arc)) < 1 / 80)
    height[dust] += 0.2
    two = (arc > 15) & (arc < 20) & (rng.uniform(size=len(arc)) < 0.4)
    height[two] += 0.03
    at, wheel = excitation(arc, height)
    stretch = {name: wheel.uncertain[(at > low) & (at < high)].mean() for name, low, high in PLACES}
    assert not wheel.gap.any()
    assert stretch["clean"] == stretch["dust"] == 0
    assert stretch["two surfaces"] > 0.5
    assert stretch["rows of points 18 cm apart"] > 0.5
    # The standard deviation dips at knots, but no sample between doubtful ones of its footprint is certain.
    between = np.diff(at[wheel.uncertain])
    assert ((between < STEP_M + 1e-9) | (between >= default_settings("wheels")["footprint_m"])).all()
    assert (wheel.std_m[wheel.uncertain] < default_settings("wheels")["max_std_m"]).any()


PLACES = (
    ("clean", 0.5, 4.5),
    ("dust", 5.0, 10.0),
    ("two surfaces", 15.5, 19.5),
    ("rows of points 18 cm apart", 30.5, 32.5),
)
