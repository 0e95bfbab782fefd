"""Whether the IMU and a trajectory tell of the same motion: clocks, units, axes, gravity."""

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from card.artifacts import Figure
from card.estimation.imu import Imu
from card.geometry import Trajectory

Array = NDArray[np.float64]
GRAVITY = 9.80665
#: A named cause must explain the IMU this many times better than taking it as it is.
MUCH_BETTER = 3.0
#: Shares of a misread unit that pass as that unit.
UNIT_TOLERANCE = 0.1
#: Offsets between the clocks that are searched, s, and how finely at first.
LARGEST_OFFSET_S, OFFSET_STEP_S = 0.3, 0.01
#: How far gravity may lie from the frame's z, m/s^2, before it speaks against a reading of the axes.
TILTED = 2.0
#: Rotation of a window, rms in rad, below which the gyro says nothing about clocks and axes.
LEAST_ROTATION = 0.005
#: Share of the squared rotations that a gyro with right axes and unit may leave unexplained.
UNEXPLAINED = 0.25


@dataclass(frozen=True)
class Windows:
    """The trajectory by windows of time: edges (W+1,) ns, and (W, 3) rad, the rotation within each."""

    edges_ns: NDArray[np.int64]
    rotated: Array

    @property
    def turns(self) -> bool:
        """Whether there is enough rotation to tell axes and clocks by it."""
        return len(self.rotated) > 2 and float(np.sqrt(np.mean(self.rotated**2) * 3)) > LEAST_ROTATION


def imu_figures(imu: Imu, trajectory: Trajectory, window_s: float) -> tuple[list[Figure], list[str]]:
    """Figures of agreement and notes that name a likely cause where there is none.

    `window_s` is the time over which the gyro is integrated and velocities are taken. Figures that cannot be
    determined, because the IMU covers less than three windows or the car does not turn, are None.
    """
    notes: list[str] = []
    rotation_error = gravity_error = magnitude = offset_ms = None
    if len(imu.t_ns) > 2 and imu.t_ns[-1] - imu.t_ns[0] >= 3e9 * window_s:
        windows = windows_of(imu, trajectory, window_s)
        integrated = integrated_gyro(imu, windows.edges_ns)
        rotation_error = float(np.degrees(_median_error(integrated, windows.rotated)))
        notes += gyro_cause(imu, windows)
        if windows.turns:
            offset_ms = 1e3 * clock_offset(imu, windows)[0]
        up = mean_specific_force(imu, trajectory, window_s)
        magnitude = float(np.linalg.norm(up))
        gravity_error = float(np.degrees(np.arccos(np.clip(up[2] / magnitude, -1.0, 1.0))))
        notes += accel_unit_cause(imu) + accel_cause(imu, trajectory, windows.edges_ns)
    figures = [
        Figure(
            "gyro_rotation_error_deg",
            rotation_error,
            "deg",
            f"median difference of gyro integrated over {window_s:g} s and the trajectory's rotation",
        ),
        Figure(
            "gravity_error_deg",
            gravity_error,
            "deg",
            "angle between the mean specific force, less the trajectory's acceleration, and the world's up",
        ),
        Figure(
            "gravity_magnitude_error_m_s2",
            None if magnitude is None else abs(magnitude - GRAVITY),
            "m/s^2",
            "difference of the mean specific force, corrected the same way, from standard gravity",
        ),
        Figure(
            "clock_offset_ms",
            offset_ms,
            "ms",
            "by how much the IMU's clock is ahead of the trajectory's, from their rotations",
        ),
    ]
    return figures, notes


def windows_of(imu: Imu, trajectory: Trajectory, window_s: float) -> Windows:
    """Windows of at least `window_s` between times of the trajectory, away from the ends of the IMU."""
    margin = int(LARGEST_OFFSET_S * 1e9)
    t_ns = trajectory.t_ns
    inside = t_ns[(t_ns >= imu.t_ns[0] + margin) & (t_ns <= imu.t_ns[-1] - margin)]
    if len(inside) < 4:
        inside = t_ns[(t_ns >= imu.t_ns[0]) & (t_ns <= imu.t_ns[-1])]
    edges = [int(inside[0])]
    for t in inside[1:]:
        # A nanosecond of slack: stamps of a regular clock are rounded.
        if t - edges[-1] >= window_s * 1e9 - 1:
            edges.append(int(t))
    pose = trajectory.at(edges)[:, :3, :3]
    rotated = Rotation.from_matrix(np.swapaxes(pose[:-1], 1, 2) @ pose[1:]).as_rotvec()
    return Windows(np.array(edges, dtype=np.int64), rotated)


def integrated_gyro(imu: Imu, edges_ns: NDArray[np.int64], shift_s: float = 0.0) -> Array:
    """Angles (W, 3) rad of the gyro between edges (W+1,) moved by a shift."""
    seconds = (imu.t_ns - imu.t_ns[0]) * 1e-9
    steps = 0.5 * (imu.gyro[1:] + imu.gyro[:-1]) * np.diff(seconds)[:, None]
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    at = (edges_ns - imu.t_ns[0]) * 1e-9 + shift_s
    return np.diff(np.stack([np.interp(at, seconds, total[:, axis]) for axis in range(3)], axis=1), axis=0)


def clock_offset(imu: Imu, windows: Windows) -> tuple[float, float]:
    """Seconds to add to the trajectory's times to have the IMU's, and its sigma.

    The rotations are compared less their mean, in which the gyro's bias is; where swapped axes or another
    unit leave them unexplained, only their sizes. Beside a steady turn, sizes hardly tell of another axis.
    The sigma is that of a least-squares fit: the misfit that is left, over the misfit's curvature.
    """
    wanted = np.linalg.norm(windows.rotated, axis=1)
    turned = windows.rotated - windows.rotated.mean(axis=0)

    def of_sizes(shift: float) -> float:
        found = np.linalg.norm(integrated_gyro(imu, windows.edges_ns, shift), axis=1)
        scale = (found @ wanted) / max(found @ found, 1e-12)
        return float(np.sum((scale * found - wanted) ** 2))

    def of_axes(shift: float) -> float:
        found = integrated_gyro(imu, windows.edges_ns, shift)
        return float(np.sum((found - found.mean(axis=0) - turned) ** 2))

    shifts = np.arange(-LARGEST_OFFSET_S, LARGEST_OFFSET_S + 1e-9, OFFSET_STEP_S)
    fits = [(misfit, [misfit(shift) for shift in shifts]) for misfit in (of_sizes, of_axes)]
    # Axes that are swapped, or a rate in degrees, leave most of what turned unexplained.
    right = min(fits[1][1]) < UNEXPLAINED * float(np.sum(turned**2))
    misfit, values = fits[1] if right else fits[0]
    best = float(shifts[int(np.argmin(values))])
    bounds = (best - OFFSET_STEP_S, best + OFFSET_STEP_S)
    found = float(minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-5}).x)
    left, h = misfit(found), OFFSET_STEP_S
    curvature = (misfit(found - h) - 2 * left + misfit(found + h)) / (2 * h * h)
    variance = left / max(len(wanted) - 2, 1) / curvature if curvature > 0 else np.inf
    return found, float(np.sqrt(variance))


def mean_specific_force(imu: Imu, trajectory: Trajectory, window_s: float) -> Array:
    """Mean specific force (3,) in world, m/s^2, less the mean acceleration of the trajectory itself."""
    half = int(window_s * 0.5e9)
    start, end = int(imu.t_ns[0]) + half, int(imu.t_ns[-1]) - half
    inside = (imu.t_ns >= start) & (imu.t_ns <= end)
    rotation = trajectory.at(imu.t_ns[inside])[:, :3, :3]
    force = np.einsum("nij,nj->ni", rotation, imu.accel[inside]).mean(axis=0)
    ends = trajectory.at([start - half, start + half, end - half, end + half])[:, :3, 3]
    velocity_start, velocity_end = (ends[1] - ends[0]) / window_s, (ends[3] - ends[2]) / window_s
    result: Array = force - (velocity_end - velocity_start) / ((end - start) / 1e9)
    return result


def gyro_cause(imu: Imu, windows: Windows) -> list[str]:
    """The unit and axes that explain the gyro much better than what it claims to be."""
    if not windows.turns:
        return []
    shift, _ = clock_offset(imu, windows)
    integrated = integrated_gyro(imu, windows.edges_ns, shift)
    best, cause = _median_error(integrated, windows.rotated) / MUCH_BETTER, []
    for scale, unit in ((1.0, "rad/s"), (np.pi / 180, "deg/s")):
        for axes, signs in _readings():
            error = _median_error(scale * integrated[:, axes] * signs, windows.rotated)
            if error < best:
                best, cause = (
                    error,
                    [f"gyro agrees with the trajectory if read as {unit} with axes {_named(axes, signs)}"],
                )
    return cause


def accel_unit_cause(imu: Imu) -> list[str]:
    """Whether the accelerometer gives g instead of m/s^2."""
    typical = float(np.median(np.linalg.norm(imu.accel, axis=1)))
    if abs(typical - 1) < UNIT_TOLERANCE:
        return [f"specific force is {typical:.3f} in the median: the accelerometer is in g"]
    return []


def accel_cause(imu: Imu, trajectory: Trajectory, edges_ns: NDArray[np.int64]) -> list[str]:
    """The axes that explain the specific force much better than those it claims.

    Over two windows, the mean force in a fixed frame is the second difference of position, plus gravity.
    """
    if len(edges_ns) < 6:
        return []
    pose = trajectory.at(edges_ns)
    seconds = np.diff(edges_ns) * 1e-9
    velocity = np.diff(pose[:, :3, 3], axis=0) / seconds[:, None]
    between = 0.5 * (seconds[1:] + seconds[:-1])
    acceleration = np.diff(velocity, axis=0) / between[:, None]
    rotation = trajectory.at(np.clip(imu.t_ns, trajectory.start_ns, trajectory.end_ns))[:, :3, :3]
    # Every reading's force in the fixed frame is a sum over these products of attitude and specific force.
    products = np.einsum("nij,nk->nijk", rotation, imu.accel).reshape(-1, 27)
    means = _triangular_means(imu.t_ns, products, edges_ns).reshape(-1, 3, 3, 3)
    best, cause = np.inf, []
    for axes, signs in _readings():
        gravity = np.einsum("wijj,j->wi", means[..., axes], np.array(signs)) - acceleration
        gravity = gravity[np.isfinite(gravity).all(axis=1)]
        mean = gravity.mean(axis=0)
        error = float(np.median(np.linalg.norm(gravity - mean, axis=1)))
        # Against a gravity of its own, every reading with z elsewhere would be as good at standstill.
        error += max(float(np.linalg.norm(mean - [0, 0, np.linalg.norm(mean)])) - TILTED, 0.0)
        if axes == (0, 1, 2) and signs == (1.0, 1.0, 1.0):
            best = error / MUCH_BETTER
        elif error < best:
            best = error
            cause = [f"accelerometer agrees with the trajectory if read with axes {_named(axes, signs)}"]
    return cause


def _triangular_means(t_ns: NDArray[np.int64], values: Array, edges_ns: NDArray[np.int64]) -> Array:
    """Means (W-1, C) of values (N, C) around each inner edge, weighted down to zero at its neighbours.

    NaN where no value is.
    """
    means = []
    for before, middle, after in zip(edges_ns, edges_ns[1:], edges_ns[2:], strict=False):
        inside = (t_ns >= before) & (t_ns <= after)
        t = t_ns[inside]
        weight = np.where(t < middle, (t - before) / (middle - before), (after - t) / (after - middle))
        means.append(
            weight @ values[inside] / weight.sum() if weight.sum() > 0 else np.full(values.shape[1], np.nan)
        )
    return np.stack(means)


def _readings() -> list[tuple[tuple[int, ...], tuple[float, ...]]]:
    """All orders and signs of three axes, as they are first."""
    return list(product(permutations(range(3)), product((1.0, -1.0), repeat=3)))


def _named(axes: tuple[int, ...], signs: tuple[float, ...]) -> str:
    return (
        "(" + ", ".join(f"{'-' if s < 0 else ''}{'xyz'[a]}" for a, s in zip(axes, signs, strict=True)) + ")"
    )


def _median_error(integrated: Array, rotated: Array) -> float:
    return float(np.median(np.linalg.norm(integrated - rotated, axis=1)))
