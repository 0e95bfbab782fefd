"""Wheel excitation against the simulated road: the mean surface under each tyre's footprint."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json, read_table
from card.geometry import Trajectory, apply, inverse

WHEELS = ("fl", "fr", "rl", "rr")
RMS_AIM_MM, MAX_AIM_MM = 1.0, 5.0


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Rms and worst height error over all samples of all sequences that are no gap, and the share of gaps.

    work : folder with ``results/<id>/`` of wheels and poses; truth : with ``<id>/wheels.parquet`` and
    ``<id>/trajectory.parquet``.
    """
    errors, gaps = [np.zeros(0)], [np.zeros(0, dtype=bool)]
    for sequence in sequences:
        if (work / "results" / sequence / "wheel_excitation.json").is_file() and (truth / sequence).is_dir():
            error, gap = height_errors_mm(work / "results" / sequence, truth / sequence)
            errors.append(error[~gap])
            gaps.append(gap)
    error, gap = np.concatenate(errors), np.concatenate(gaps)
    figures = [
        ("rms_mm", float(np.sqrt(np.mean(error**2))) if error.size else None, "mm", RMS_AIM_MM),
        ("max_mm", float(np.abs(error).max()) if error.size else None, "mm", MAX_AIM_MM),
        ("gap_pct", 100 * float(gap.mean()) if gap.size else None, "%", None),
    ]
    return [
        {"stage": "wheels", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": "lower"}
        for figure, value, unit, aim in figures
    ]


def height_errors_mm(results: Path, truth: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Errors (S,) along the rig's z of all wheels' contacts, each in its own trajectory's rig, and gaps (S,).

    In rig, because that is what the excitation is for: the road under the sensors. Drift of the whole
    trajectory is a figure of the poses.
    """
    wheels = read_json(results / "wheel_excitation.json", "wheel_excitation")["wheels"]
    found_path, true_path = (
        Trajectory.from_table(read_table(folder / "trajectory.parquet", "trajectory"))
        for folder in (results, truth)
    )
    table = read_table(truth / "wheels.parquet", "truth_wheels")
    column = {name: np.asarray(table[name]) for name in ("wheel", "t_ns", "x", "y", "z")}
    errors, gaps = [], []
    for wheel in WHEELS:
        of_wheel = column["wheel"] == wheel
        true_t = column["t_ns"][of_wheel]
        true = np.stack([column[axis][of_wheel] for axis in "xyz"], axis=1)
        t_ns = np.array([row[0] for row in wheels[wheel]["samples"]], dtype=np.int64)
        found = np.array([row[1:4] for row in wheels[wheel]["samples"]])
        _, ours, theirs = np.intersect1d(t_ns, true_t, assume_unique=True, return_indices=True)
        height = apply(inverse(found_path.at(t_ns[ours])), found[ours])[:, 2]
        true_height = apply(inverse(true_path.at(true_t[theirs])), true[theirs])[:, 2]
        errors.append(1e3 * (height - true_height))
        gaps.append(np.array(wheels[wheel]["gap"])[ours])
    return np.concatenate(errors), np.concatenate(gaps)
