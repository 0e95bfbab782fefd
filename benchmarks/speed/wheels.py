"""Wheel excitation at the size of a real drive, and its spline beside scipy's optimizer."""

from pathlib import Path
from typing import Any

import numpy as np
from ceres_reference import corridor, wheel_settings
from cost import cpu_s
from field import field_drive
from field_ground_truth import inputs_of
from own_process import Spent, alone
from scipy.interpolate import BSpline
from scipy.optimize import least_squares
from scipy.sparse import csr_array, diags_array, eye_array, hstack, vstack
from ten_minutes import Long, ten_minutes
from wheel_inputs import THREADS, excite_only, static_of

from card.wheels.profile import fit_profile

DRIVE, SEED, SECONDS = "de_town_bumps", 1, 45.0
LENGTH_M, SHORT_M = 5000.0, 50.0  # ten minutes at 30 km/h; what scipy gets


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows `cpu_s_10min`, `wall_s_10min` and `peak_gb_10min`: the whole stage on ten minutes, reading
    included, in a process of its own and two workers. The wall time is that of one run, and counts where two
    cores are free: there it is `alone_s_10min`, what the process does alone, and half of the rest.
    `spline_s_10min` of it for four splines; `spline_ratio`: the time of scipy's
    `least_squares` with the same loss by that of the fit."""
    inputs = inputs_of(field_drive(DRIVE, SEED, SECONDS), scratch / "inputs")
    drive = inputs.recording, inputs.bursts, inputs.calibration, inputs.trajectory
    long = ten_minutes(inputs, static_of(scratch, *drive), scratch / "long")
    stage = stage_cost(long.folder, inputs.calibration)
    points = corridor(LENGTH_M)
    spline = 4 * cpu_s(lambda: fit_profile(*points, wheel_settings()), repeats)
    short = corridor(SHORT_M)
    fast = cpu_s(lambda: fit_profile(*short, wheel_settings()), repeats)
    slow = cpu_s(lambda: _least_squares(*short), repeats)
    return [
        _row("cpu_s_10min", stage.own_s + stage.children_s, "CPU-s", 120.0, "lower"),
        _row("alone_s_10min", stage.own_s, "CPU-s", None, "lower"),
        _row("wall_s_10min", stage.wall_s, "s", 60.0, "lower"),
        _row("peak_gb_10min", stage.peak_gb + THREADS * stage.child_peak_gb, "GB", None, "lower"),
        _row("spline_s_10min", spline, "CPU-s", None, "lower"),
        _row("spline_ratio", slow / fast, "1", None, "higher"),
    ]


def stage_cost(folder: Path, calibration: Path) -> Spent:
    """The cost of the stage on the drive in `folder`."""
    return alone(_excite, folder, calibration)[1]


def _excite(folder: Path, calibration: Path) -> None:
    long = Long(folder)
    excite_only(folder, folder, long.bursts, long.frames, calibration, long.trajectory, long.static_voxels)


def _least_squares(arc: Any, sideways: Any, height: Any) -> Any:
    """The same objective with a callable loss and a sparse Jacobian, from level ground, not annealed."""
    s = wheel_settings()
    start = arc.min() - s.knot_spacing_m
    count = int(np.ceil((arc.max() - start) / s.knot_spacing_m)) + 4
    along = BSpline.design_matrix(arc, start + s.knot_spacing_m * np.arange(-3, count + 1), 3)
    tilt = diags_array(sideways / s.corridor_half_width_m) @ along
    second = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(count - 2, count))
    nothing = csr_array((count - 2, count))
    jacobian = csr_array(
        vstack(
            [
                hstack([along, tilt]),
                hstack([s.penalty**0.5 * second, nothing]),
                hstack([csr_array((count, count)), s.tilt_penalty**0.5 * eye_array(count)]),
            ]
        )
    )
    wanted = np.concatenate([height, np.zeros(jacobian.shape[0] - len(arc))])

    def loss(z: Any) -> Any:
        inside = np.maximum(0.0, 1 - z)
        rho = np.stack([(1 - inside**3) / 3, inside**2, -2 * inside])
        plain = z[len(arc) :]
        rho[:, len(arc) :] = np.stack([plain, np.ones_like(plain), np.zeros_like(plain)])
        return rho

    return least_squares(
        lambda c: jacobian @ c - wanted, np.zeros(2 * count), lambda _: jacobian, loss=loss, f_scale=s.tukey_m
    )


def _row(figure: str, value: float, unit: str, aim: float | None, better: str) -> dict[str, Any]:
    return {"stage": "wheels", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": better}
