"""What the IMU measures on the car's path: specific force and rate, with noise and slowly walking biases."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, matrix_from_quaternion
from card.simulation.rig import ImuUnit

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
RATE_HZ = 200


@dataclass(frozen=True)
class ImuErrors:
    """A good MEMS unit: noise densities, biases at the start (one sigma) and their walks, SI, per root Hz."""

    gyro_noise: float = 1.0e-4
    accel_noise: float = 1.0e-3
    gyro_bias: float = 1.0e-3
    accel_bias: float = 0.02
    gyro_walk: float = 1.0e-6
    accel_walk: float = 2.0e-5


def imu_times(start_ns: int, duration_s: float) -> NDArray[np.int64]:
    """Sample times (N,) in ns from the start to the end of the recording, both included."""
    return start_ns + np.arange(round(duration_s * RATE_HZ) + 1, dtype=np.int64) * (1_000_000_000 // RATE_HZ)


def ideal_imu(path: Trajectory, t_ns: NDArray[np.int64]) -> tuple[Array, Array]:
    """True rate (N, 3) rad/s and specific force (N, 3) m/s^2 in the rig at times inside ``path``."""
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation

    seconds = (path.t_ns - path.start_ns) * 1e-9
    at = (t_ns - path.start_ns) * 1e-9
    acceleration = CubicSpline(seconds, path.translation_m)(at, 2)
    rotation = matrix_from_quaternion(path.rotation_wxyz)
    step = seconds[1] - seconds[0]
    turn = np.einsum("nji,njk->nik", rotation[:-2], rotation[2:])
    rates = Rotation.from_matrix(turn).as_rotvec() / (2 * step)
    rate = CubicSpline(seconds[1:-1], rates)(at)
    force = np.einsum("nji,nj->ni", path.at(t_ns)[:, :3, :3], acceleration + np.array([0, 0, GRAVITY_M_S2]))
    return rate, force


def measured_imu(
    path: Trajectory, t_ns: NDArray[np.int64], errors: ImuErrors, unit: ImuUnit, rng: np.random.Generator
) -> dict[str, NDArray[np.generic]]:
    """The IMU's table (schema ``imu``) at times t_ns (N,).

    What is measured is unit @ true + bias + noise; the bias starts anywhere and walks at random.
    """
    rate, force = ideal_imu(path, t_ns)
    rate, force = rate @ unit.gyro.T, force @ unit.accel.T
    columns: dict[str, NDArray[np.generic]] = {"t_ns": t_ns}
    for name, values, noise, bias, walk in (
        ("gyro", rate, errors.gyro_noise, errors.gyro_bias, errors.gyro_walk),
        ("accel", force, errors.accel_noise, errors.accel_bias, errors.accel_walk),
    ):
        drift = rng.normal(0, bias, 3) + np.cumsum(
            rng.normal(0, walk / np.sqrt(RATE_HZ), values.shape), axis=0
        )
        noisy = values + drift + rng.normal(0, noise * np.sqrt(RATE_HZ), values.shape)
        columns.update({f"{name}_{axis}": noisy[:, i] for i, axis in enumerate("xyz")})
    return columns
