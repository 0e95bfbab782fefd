"""The spline of a wheel as a problem for Ceres: an independent solver of the same minimum."""

import numpy as np
import pyceres
from numpy.typing import NDArray

from card.artifacts import default_settings
from card.wheels.normal_equations import uniform_basis
from card.wheels.profile import Profile, SplineSettings, fit_profile

Array = NDArray[np.float64]
MAX_ITERATIONS, TOLERANCE = 200, 1e-14
#: What the corridor of a wheel holds at full scale and the speed of a town.
POINTS_PER_M = 240
#: How far beside the spline Ceres starts, m.
OFF_M = 1e-3


class TukeyLoss(pyceres.LossFunction):  # type: ignore[misc]
    """Ceres' own form: rho(s) = a^2 / 3 (1 - (1 - s / a^2)^3) inside the scale a, constant outside."""

    def __init__(self, scale: float) -> None:
        super().__init__()
        self._square = scale * scale

    def Evaluate(self, s: float, out: Array) -> None:
        """Value, slope and curvature at a squared residual `s` into `out` (3,)."""
        inside = 1 - s / self._square
        if inside > 0:
            out[:] = self._square / 3 * (1 - inside**3), inside**2, -2 / self._square * inside
        else:
            out[:] = self._square / 3, 0.0, 0.0


class Linear(pyceres.CostFunction):  # type: ignore[misc]
    """Residual sum of row . block - wanted, over one row (2,) a block: elevation and tilt of one knot."""

    def __init__(self, rows: Array, wanted: float) -> None:
        super().__init__()
        self._rows, self._wanted = rows, wanted
        self.set_num_residuals(1)
        self.set_parameter_block_sizes([2] * len(rows))

    def Evaluate(self, blocks: list[Array], residuals: Array, jacobians: list[Array] | None) -> bool:
        """The residual and, where asked for, its constant Jacobians."""
        total = -self._wanted
        for row, block in zip(self._rows, blocks, strict=True):
            total += row[0] * block[0] + row[1] * block[1]
        residuals[0] = total
        if jacobians is not None:
            for row, jacobian in zip(self._rows, jacobians, strict=True):
                jacobian[:] = row
        return True


def difference_um(length_m: float) -> float:
    """Greatest difference of the coefficients over a road of this length, micrometres."""
    settings = wheel_settings()
    points = corridor(length_m)
    profile, _, _ = fit_profile(*points, settings)
    return 1e6 * float(np.abs(profile.coefficients - ceres_coefficients(*points, profile, settings)).max())


def wheel_settings() -> SplineSettings:
    """The default settings of the spline."""
    defaults = default_settings("wheels")
    return SplineSettings(**{name: defaults[name] for name in SplineSettings.__dataclass_fields__})


def corridor(length_m: float) -> tuple[Array, Array, Array]:
    """Arc length, sideways offset and height (N,) of a rough road's points with dust and passing wheels."""
    rng = np.random.default_rng(11)
    count = round(length_m * POINTS_PER_M)
    arc, sideways = np.sort(rng.uniform(0, length_m, count)), rng.uniform(-0.12, 0.12, count)
    height = 0.03 * np.sin(1.3 * arc) + 0.01 * np.sin(9 * arc) + 0.05 * sideways * np.sin(0.7 * arc)
    height += rng.normal(0, 0.004, count)
    dust = rng.uniform(size=count) < 0.08
    height[dust] += rng.uniform(0.03, 0.3, np.count_nonzero(dust))
    cluster = (arc % 40 > 38) & (rng.uniform(size=count) < 0.45)
    height[cluster] = 0.2 + rng.normal(0, 0.01, np.count_nonzero(cluster))
    return arc, sideways, height


def ceres_coefficients(
    arc: Array, sideways: Array, height: Array, profile: Profile, settings: SplineSettings
) -> Array:
    """Coefficients (K, 2) at which Ceres ends that begins `OFF_M` beside those of a profile.

    Tukey's loss has many minima, each cluster of outliers another: Ceres is asked for the one that was found.
    """
    blocks = list(profile.coefficients + OFF_M)
    first, basis = uniform_basis(arc, profile.start_m, profile.spacing_m, len(blocks))
    across = sideways / settings.corridor_half_width_m
    problem, tukey = pyceres.Problem(), TukeyLoss(settings.tukey_m)
    kept = []  # Ceres holds the costs, Python their methods

    def add(rows: Array, wanted: float, loss: TukeyLoss | None, first_block: int) -> None:
        kept.append(Linear(rows, wanted))
        problem.add_residual_block(kept[-1], loss, blocks[first_block : first_block + len(rows)])

    for i, values, x, h in zip(first.tolist(), basis, across.tolist(), height.tolist(), strict=True):
        add(np.stack([values, values * x], axis=1), h, tukey, i)
    tilt = np.array([[0.0, np.sqrt(settings.tilt_penalty)]])
    bend = np.sqrt(settings.penalty) * np.array([[1.0, 0.0], [-2.0, 0.0], [1.0, 0.0]])
    for k in range(len(blocks)):
        add(tilt, 0.0, None, k)
        if k + 3 <= len(blocks):
            add(bend, 0.0, None, k)
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.SPARSE_NORMAL_CHOLESKY
    options.max_num_iterations = MAX_ITERATIONS
    options.function_tolerance = options.parameter_tolerance = options.gradient_tolerance = TOLERANCE
    options.num_threads = 1
    pyceres.solve(options, problem, pyceres.SolverSummary())
    return np.stack(blocks)
