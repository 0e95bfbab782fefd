"""What a team delivers of a drive: a trajectory that is refined yet not quite the truth, perhaps a bag."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_file
from card.geometry import Trajectory, quaternion_from_matrix, transform
from card.simulation.bag_delivery import as_bag

__all__ = ["as_bag", "write_trajectory"]

Array = NDArray[np.float64]

RATE_HZ = 200
DRIFT_M, DRIFT_RAD = 0.006, np.radians(0.012)
"""One sigma an axis of the slow error: 1 cm and 0.02 degrees in all."""
JITTER_M, JITTER_RAD = 2e-4, np.radians(0.002)
"""One sigma an axis of the fast error."""

_PERIODS_S = (18.0, 70.0)
_WAVES = 6
_JITTER_S = 0.05  # what a smoother leaves is not white


def write_trajectory(recording: Path, trajectory: Trajectory, seed: int) -> None:
    """Write `recording`/trajectory.tum: lines ``t[s] x y z qx qy qz qw`` of the rig at 200 Hz.

    trajectory : the true ``world_from_rig``. The delivered one lives in a frame of its own, whose z is up
    and whose origin and heading are anyhow. Its error wanders slowly by DRIFT and trembles by JITTER.
    """
    rng = np.random.default_rng([seed, trajectory.start_ns])
    t_ns = np.arange(trajectory.start_ns, trajectory.end_ns + 1, 1_000_000_000 // RATE_HZ)
    noisy = _disturbed(trajectory.at(t_ns), (t_ns - t_ns[0]) / 1e9, rng)
    poses = _start(rng) @ noisy
    quaternions = quaternion_from_matrix(poses[:, :3, :3])
    lines = [
        f"{t // 10**9}.{t % 10**9:09d} {x:.6f} {y:.6f} {z:.6f} {qx:.9f} {qy:.9f} {qz:.9f} {qw:.9f}\n"
        for t, (x, y, z), (qw, qx, qy, qz) in zip(
            t_ns.tolist(), poses[:, :3, 3].tolist(), quaternions.tolist(), strict=True
        )
    ]
    with atomic_file(recording / "trajectory.tum") as partial:
        partial.write_text("".join(lines), encoding="ascii")


def _start(rng: np.random.Generator) -> Array:
    half = rng.uniform(-np.pi, np.pi) / 2
    return transform(rng.uniform(-200.0, 200.0, 3), [np.cos(half), 0.0, 0.0, np.sin(half)])


def _disturbed(poses: Array, seconds: Array, rng: np.random.Generator) -> Array:
    """Poses (N, 4, 4) shifted and turned in the world by an error that is zero at no time in particular."""
    error = np.concatenate(
        [
            _wander(seconds, rng) * DRIFT_M + _tremble(len(seconds), rng) * JITTER_M,
            _wander(seconds, rng) * DRIFT_RAD + _tremble(len(seconds), rng) * JITTER_RAD,
        ],
        axis=1,
    )
    half = np.concatenate([np.ones((len(seconds), 1)), 0.5 * error[:, 3:]], axis=1)
    result = poses.copy()
    result[:, :3, :3] = transform(np.zeros(3), half)[:, :3, :3] @ poses[:, :3, :3]
    result[:, :3, 3] += error[:, :3]
    return result


def _wander(seconds: Array, rng: np.random.Generator) -> Array:
    """Slow noise (N, 3) of unit variance: a few long waves."""
    periods = rng.uniform(*_PERIODS_S, (_WAVES, 3))
    phases = rng.uniform(0, 2 * np.pi, (_WAVES, 3))
    waves = np.sin(2 * np.pi * seconds[:, None, None] / periods + phases)
    return np.asarray(waves.sum(axis=1) * np.sqrt(2 / _WAVES))


def _tremble(count: int, rng: np.random.Generator) -> Array:
    """Fast noise (N, 3) of unit variance, correlated over _JITTER_S."""
    from scipy.signal import lfilter

    keep = np.exp(-1 / (RATE_HZ * _JITTER_S))
    white = rng.normal(size=(count, 3))
    white[1:] *= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=0))
