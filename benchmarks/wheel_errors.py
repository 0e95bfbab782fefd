"""Errors of wheel contacts against the simulated road: the mean surface under each tyre's footprint."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tyre_ground import ground_under

from card.artifacts import read_json, read_table
from card.geometry import Trajectory, apply, inverse

Array = NDArray[np.float64]
WHEELS = ("fl", "fr", "rl", "rr")


@dataclass(frozen=True)
class WheelErrors:
    """Of S samples: error along the rig's z in mm, whether it is a gap, uncertain, and lies across a wall."""

    height_mm: Array
    gap: NDArray[np.bool_]
    uncertain: NDArray[np.bool_]
    wall: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: "list[WheelErrors]") -> "WheelErrors":
        """All samples of the parts."""
        names = cls.__dataclass_fields__
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Samples (S,) that the stage stands for: neither gaps nor uncertain."""
        return ~(self.gap | self.uncertain)


def wheel_errors(wheel_excitation: Path, trajectory: Path, truth: Path) -> WheelErrors:
    """Errors of all wheels' contacts, each in its own trajectory's rig.

    In rig, because that is what the excitation is for: the road under the sensors. Drift of the whole
    trajectory is a figure of the poses. The road is the surface that the sensors saw.

    truth : with wheels.parquet, trajectory.parquet and world.npz.
    """
    wheels = read_json(wheel_excitation, "wheel_excitation")["wheels"]
    found_path, true_path = (
        Trajectory.from_table(read_table(path, "trajectory"))
        for path in (trajectory, truth / "trajectory.parquet")
    )
    table = read_table(truth / "wheels.parquet", "truth_wheels")
    column = {name: np.asarray(table[name]) for name in ("wheel", "t_ns", "x", "y", "z")}
    parts = []
    for wheel in WHEELS:
        of_wheel = column["wheel"] == wheel
        true_t = column["t_ns"][of_wheel]
        true = np.stack([column[axis][of_wheel] for axis in "xyz"], axis=1)
        t_ns = np.array([row[0] for row in wheels[wheel]["samples"]], dtype=np.int64)
        found = np.array([row[1:4] for row in wheels[wheel]["samples"]])
        _, ours, theirs = np.intersect1d(t_ns, true_t, assume_unique=True, return_indices=True)
        height = apply(inverse(found_path.at(t_ns[ours])), found[ours])[:, 2]
        true_rig = true_path.at(true_t[theirs])
        ground = ground_under(truth / "world.npz", true[theirs], true_rig[:, :2, 1])
        on_ground = np.column_stack([true[theirs, :2], ground.height])
        true_height = apply(inverse(true_rig), on_ground)[:, 2]
        parts.append(
            WheelErrors(
                1e3 * (height - true_height),
                np.array(wheels[wheel]["gap"])[ours],
                np.array(wheels[wheel]["uncertain"])[ours],
                ground.wall,
            )
        )
    return WheelErrors.joined(parts)
