"""Wheel excitation against the simulated road, with estimated and with true poses, and against Ceres."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from wheel_errors import WheelErrors, wheel_errors
from wheel_inputs import excite_with

from card.artifacts import read_json

RMS_AIM_MM, MAX_AIM_MM, TRUE_POSES_AIM_MM, CERES_AIM_UM = 1.0, 5.0, 0.6, 10.0


def rows(work: Path, truth: Path, sequences: Sequence[str]) -> list[dict[str, Any]]:
    """Figures over all samples of all sequences.

    `rms_mm` and `max_mm` are of the measured samples that do not cross a wall; those that do have rows of
    their own, and so has what is flagged. `rms_true_poses_mm` is the same rms with the true poses and
    calibration.

    work : folder with ``results/<id>/`` of wheels and poses; truth : with ``<id>/wheels.parquet``,
    ``<id>/trajectory.parquet``, ``<id>/world.npz`` and ``sessions/``.
    """
    done = [
        sequence
        for sequence in sequences
        if (work / "results" / sequence / "wheel_excitation.json").is_file()
        and (truth / sequence / "wheels.parquet").is_file()
    ]
    if not done:
        return [_row(name, None, unit, aim) for name, unit, aim in FIGURES]
    found, true = [], []
    for sequence in done:
        results = work / "results" / sequence
        paths = results / "wheel_excitation.json", results / "trajectory.parquet"
        found.append(wheel_errors(*paths, truth / sequence))
        true.append(_with_true_poses(work, truth, sequence))
    values = {
        **figures(WheelErrors.joined(found)),
        "rms_true_poses_mm": figures(WheelErrors.joined(true))["rms_mm"],
    }
    values["ceres_max_um"] = ceres_max_um()
    return [_row(name, values[name], unit, aim) for name, unit, aim in FIGURES]


FIGURES = (
    ("rms_mm", "mm", RMS_AIM_MM),
    ("max_mm", "mm", MAX_AIM_MM),
    ("walls_rms_mm", "mm", None),
    ("walls_max_mm", "mm", None),
    ("walls_pct", "%", None),
    ("gap_pct", "%", None),
    ("uncertain_pct", "%", None),
    ("rms_true_poses_mm", "mm", TRUE_POSES_AIM_MM),
    ("ceres_max_um", "um", CERES_AIM_UM),
)


def figures(errors: WheelErrors) -> dict[str, float | None]:
    """Rms and worst height error of measured samples, off walls and across them, and shares of the rest."""
    off, across = (errors.height_mm[errors.measured & (errors.wall == wall)] for wall in (False, True))
    return {
        "rms_mm": _rms(off),
        "max_mm": _worst(off),
        "walls_rms_mm": _rms(across),
        "walls_max_mm": _worst(across),
        "walls_pct": 100 * float((errors.measured & errors.wall).mean()),
        "gap_pct": 100 * float(errors.gap.mean()),
        "uncertain_pct": 100 * float((errors.uncertain & ~errors.gap).mean()),
    }


def ceres_max_um() -> float | None:
    """Greatest difference to Ceres of the coefficients over 500 m of a wheel; None without it."""
    try:
        from ceres_reference import difference_um
    except ImportError:
        return None
    return difference_um(500.0)


def _with_true_poses(work: Path, truth: Path, sequence: str) -> WheelErrors:
    results = work / "results" / sequence
    recording = results / "recording"
    if not recording.is_dir():
        recording = work / "recordings" / sequence
    session = read_json(results / "calibration.json", "calibration")["session"]["id"]
    with tempfile.TemporaryDirectory(prefix="card-wheels-") as scratch:
        excitation = excite_with(
            Path(scratch),
            recording,
            results / "bursts.parquet",
            results / "frames.parquet",
            truth / "sessions" / session / "calibration.json",
            truth / sequence / "trajectory.parquet",
        )
        return wheel_errors(excitation, truth / sequence / "trajectory.parquet", truth / sequence)


def _rms(values: Any) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _worst(values: Any) -> float | None:
    return float(np.abs(values).max()) if len(values) else None


def _row(figure: str, value: float | None, unit: str, aim: float | None) -> dict[str, Any]:
    return {"stage": "wheels", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": "lower"}
