"""Whether the IMU and a trajectory tell of the same motion: units, axes, gravity."""

from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.errors import CardError
from card.geometry import Trajectory

Array = NDArray[np.float64]
GRAVITY = 9.80665
#: A named cause must explain the gyro this many times better than taking it as it is.
MUCH_BETTER = 3.0
#: Shares of a misread unit that pass as that unit.
UNIT_TOLERANCE = 0.1


@dataclass(frozen=True)
class Imu:
    """IMU samples within a trajectory: t_ns (N,), gyro (N, 3) rad/s and accel (N, 3) m/s^2, in rig axes."""

    t_ns: NDArray[np.int64]
    gyro: Array
    accel: Array


def imu_figures(imu: Imu, trajectory: Trajectory, window_s: float) -> tuple[list[Figure], list[str]]:
    """Figures of agreement and notes that name a likely cause where there is none.

    `window_s` is the time over which the gyro is integrated and velocities are taken. Figures that cannot be
    determined, because the IMU covers less than three windows, are None.
    """
    notes: list[str] = []
    rotation_error = gravity_error = magnitude = None
    if len(imu.t_ns) > 2 and imu.t_ns[-1] - imu.t_ns[0] >= 3e9 * window_s:
        integrated, rotated = rotations(imu, trajectory, window_s)
        rotation_error = float(np.degrees(_median_error(integrated, rotated)))
        notes += [
            f"gyro agrees with the trajectory if read as {cause}"
            for cause in _gyro_cause(integrated, rotated)
        ]
        up = mean_specific_force(imu, trajectory, window_s)
        magnitude = float(np.linalg.norm(up))
        gravity_error = float(np.degrees(np.arccos(np.clip(up[2] / magnitude, -1.0, 1.0))))
        typical = float(np.median(np.linalg.norm(imu.accel, axis=1)))
        if abs(typical - 1) < UNIT_TOLERANCE:
            notes.append(f"specific force is {typical:.3f} in the median: the accelerometer is in g")
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
    ]
    return figures, notes


def rotations(imu: Imu, trajectory: Trajectory, window_s: float) -> tuple[Array, Array]:
    """Integrated gyro and the trajectory's rotation vectors, each (W, 3) rad, over windows of `window_s`."""
    from scipy.spatial.transform import Rotation

    seconds = (imu.t_ns - imu.t_ns[0]) / 1e9
    steps = 0.5 * (imu.gyro[1:] + imu.gyro[:-1]) * np.diff(seconds)[:, None]
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    edges = np.searchsorted(seconds, np.arange(0.0, seconds[-1], window_s))
    pose = trajectory.at(imu.t_ns[edges])[:, :3, :3]
    rotated = Rotation.from_matrix(np.swapaxes(pose[:-1], 1, 2) @ pose[1:]).as_rotvec()
    return total[edges[1:]] - total[edges[:-1]], rotated


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


def _median_error(integrated: Array, rotated: Array) -> float:
    return float(np.median(np.linalg.norm(integrated - rotated, axis=1)))


def _gyro_cause(integrated: Array, rotated: Array) -> list[str]:
    """The unit and axes that explain the gyro much better than what it claims to be."""
    claimed = _median_error(integrated, rotated)
    best, cause = claimed / MUCH_BETTER, []
    for scale, unit in ((1.0, "rad/s"), (np.pi / 180, "deg/s")):
        for axes in permutations(range(3)):
            for signs in product((1.0, -1.0), repeat=3):
                error = _median_error(scale * integrated[:, axes] * signs, rotated)
                if error < best:
                    names = ", ".join(
                        f"{'-' if s < 0 else ''}{'xyz'[a]}" for a, s in zip(axes, signs, strict=True)
                    )
                    best, cause = error, [f"{unit} with axes ({names})"]
    return cause


def read_imu(table: Any, start_ns: int, end_ns: int) -> Imu:
    """The samples of a table of schema ``imu`` within a span of time.

    Raises
    ------
    CardError
        If none is.
    """
    column = {name: np.asarray(table[name]) for name in ("t_ns", *_names("gyro"), *_names("accel"))}
    inside = (column["t_ns"] >= start_ns) & (column["t_ns"] <= end_ns)
    if not inside.any():
        first, last = column["t_ns"][[0, -1]] if len(inside) else ("no", "samples")
        raise CardError(
            "IMU and trajectory do not overlap",
            found=f"IMU {first}..{last} ns",
            wanted=f"samples within {start_ns}..{end_ns} ns",
        )
    gyro, accel = (
        np.stack([column[name][inside] for name in _names(kind)], axis=1) for kind in ("gyro", "accel")
    )
    return Imu(column["t_ns"][inside], gyro, accel)


def _names(kind: str) -> list[str]:
    return [f"{kind}_{axis}" for axis in "xyz"]
