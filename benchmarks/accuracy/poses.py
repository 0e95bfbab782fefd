"""Trajectory errors against the simulated motion: ATE, RPE over a second, tilt, height at revisits."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from references import SYSTEMS, reference_trajectories

from card.artifacts import read_table
from card.geometry import Trajectory, apply, inverse
from card.geometry.rigid_alignment import align

Array = NDArray[np.float64]
AIMS = {
    "ate_cm": (1.5, "cm"),
    "rpe_1s_cm": (0.4, "cm"),
    "tilt_deg": (0.01, "deg"),
    "revisit_z_mm": (5.0, "mm"),
}
#: Two visits of a place: so near, m, with so much way between, m; looked for at times so far apart, ns.
REVISIT_M, REVISIT_WAY_M, REVISIT_STEP_NS = 5.0, 80.0, 500_000_000
SECOND_NS = 1_000_000_000


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Medians over the sequences of the root mean square errors, ours and those of other systems.

    work : folder with ``results/<id>/trajectory.parquet``; truth : with ``<id>/trajectory.parquet``.
    """
    errors: dict[str, list[dict[str, float]]] = {"": [], **{f"_{system}": [] for system in SYSTEMS}}
    for sequence in sequences:
        files = [work / "results" / sequence / "trajectory.parquet", truth / sequence / "trajectory.parquet"]
        if all(file.is_file() for file in files):
            found, true = (Trajectory.from_table(read_table(file, "trajectory")) for file in files)
            errors[""].append(trajectory_errors(found, true))
            for system, other in reference_trajectories(work, sequence).items():
                errors[f"_{system}"].append(trajectory_errors(other, true))
    return [
        {
            "stage": "poses",
            "figure": figure + suffix,
            "value": _median([error[figure] for error in listed]),
            "unit": unit,
            "aim": None if suffix else aim,
            "better": "lower",
        }
        for suffix, listed in errors.items()
        for figure, (aim, unit) in AIMS.items()
    ]


def trajectory_errors(found: Trajectory, true: Trajectory) -> dict[str, float]:
    """Root mean squares at the times of `found` that `true` covers.

    ate_cm : positions after the best rigid alignment. rpe_1s_cm : translation of the relative pose over 1 s.
    tilt_deg : angle between the two directions of up, seen from the rig. revisit_z_mm : median
    over all second visits of a place of how wrong the difference in height to the first is; NaN without any.
    """
    t_ns = found.t_ns[(found.t_ns >= true.start_ns) & (found.t_ns <= true.end_ns)]
    poses, reference = found.at(t_ns), true.at(t_ns)
    aligned = apply(align(reference[:, :3, 3], poses[:, :3, 3]), poses[:, :3, 3])
    ate = np.linalg.norm(aligned - reference[:, :3, 3], axis=1)
    later = t_ns[t_ns + SECOND_NS <= t_ns[-1]] + SECOND_NS
    step, true_step = (
        inverse(start[: len(later)]) @ path.at(later) for start, path in ((poses, found), (reference, true))
    )
    rpe = np.linalg.norm((inverse(true_step) @ step)[:, :3, 3], axis=1)
    # The third row of world_from_rig is the world's up in rig.
    sine = np.linalg.norm(np.cross(poses[:, 2, :3], reference[:, 2, :3]), axis=1)
    return {
        "ate_cm": 100 * _rms(ate),
        "rpe_1s_cm": 100 * _rms(rpe),
        "tilt_deg": _rms(np.degrees(np.arcsin(sine))),
        "revisit_z_mm": 1e3 * revisit_z(found, true),
    }


def revisit_z(found: Trajectory, true: Trajectory) -> float:
    """Median error of the difference in height between the first and a later visit of a place, m."""
    start, end = max(found.start_ns, true.start_ns), min(found.end_ns, true.end_ns)
    t_ns = np.arange(start, end, REVISIT_STEP_NS)
    position = true.at(t_ns)[:, :3, 3]
    error = found.at(t_ns)[:, 2, 3] - position[:, 2]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    differences = []
    for later in range(len(t_ns)):
        distance = np.linalg.norm(position - position[later], axis=1)
        distance[way > way[later] - REVISIT_WAY_M] = np.inf
        if distance.min() < REVISIT_M:
            differences.append(abs(error[later] - error[int(np.argmin(distance))]))
    return float(np.median(differences)) if differences else float("nan")


def _median(values: Sequence[float]) -> float | None:
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else None


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
