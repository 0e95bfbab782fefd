"""A timed path of rigid transforms and its interpolation."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.errors import CardError
from card.geometry.transforms import transform

TRANSLATION_COLUMNS = ("x", "y", "z")
ROTATION_COLUMNS = ("qw", "qx", "qy", "qz")


class Trajectory:
    """Poses ``world_from_rig`` at strictly increasing times.

    Parameters
    ----------
    t_ns : (N,) int64, nanoseconds, strictly increasing, N >= 2.
    translation_m : (N, 3) metres.
    rotation_wxyz : (N, 4) unit quaternions; signs are made continuous.
    """

    def __init__(self, t_ns: ArrayLike, translation_m: ArrayLike, rotation_wxyz: ArrayLike) -> None:
        self.t_ns = np.asarray(t_ns, dtype=np.int64)
        self.translation_m = np.asarray(translation_m, dtype=np.float64)
        q = np.array(rotation_wxyz, dtype=np.float64)
        if self.t_ns.size < 2 or np.any(np.diff(self.t_ns) <= 0):
            raise CardError("trajectory times do not increase", found=f"{self.t_ns.size} poses")
        flips = np.einsum("ij,ij->i", q[1:], q[:-1]) < 0
        q[1:][np.cumsum(flips) % 2 == 1] *= -1
        self.rotation_wxyz = q / np.linalg.norm(q, axis=1, keepdims=True)

    @property
    def start_ns(self) -> int:
        """Time of the first pose."""
        return int(self.t_ns[0])

    @property
    def end_ns(self) -> int:
        """Time of the last pose."""
        return int(self.t_ns[-1])

    def at(self, t_ns: ArrayLike) -> NDArray[np.float64]:
        """Transforms (..., 4, 4) at times (...): linear in translation, slerp in rotation.

        Raises
        ------
        CardError
            If a time lies outside the trajectory: nothing is extrapolated.
        """
        t = np.asarray(t_ns, dtype=np.int64)
        if t.size and (t.min() < self.start_ns or t.max() > self.end_ns):
            raise CardError(
                "trajectory does not cover a requested time",
                found=f"{t.min()}..{t.max()} ns",
                wanted=f"{self.start_ns}..{self.end_ns} ns",
            )
        i = np.clip(np.searchsorted(self.t_ns, t, side="right") - 1, 0, self.t_ns.size - 2)
        alpha = ((t - self.t_ns[i]) / (self.t_ns[i + 1] - self.t_ns[i]))[..., None]
        translation = (1 - alpha) * self.translation_m[i] + alpha * self.translation_m[i + 1]
        return transform(translation, _slerp(self.rotation_wxyz[i], self.rotation_wxyz[i + 1], alpha))

    @classmethod
    def from_table(cls, table: Any) -> "Trajectory":
        """The trajectory of a table with the columns of schema ``trajectory``."""
        columns = {
            name: np.asarray(table[name]) for name in ("t_ns", *TRANSLATION_COLUMNS, *ROTATION_COLUMNS)
        }
        return cls(
            columns["t_ns"],
            np.stack([columns[name] for name in TRANSLATION_COLUMNS], axis=1),
            np.stack([columns[name] for name in ROTATION_COLUMNS], axis=1),
        )

    def to_table(self) -> Mapping[str, NDArray[Any]]:
        """The columns of schema ``trajectory``."""
        return {
            "t_ns": self.t_ns,
            **{name: self.translation_m[:, i] for i, name in enumerate(TRANSLATION_COLUMNS)},
            **{name: self.rotation_wxyz[:, i] for i, name in enumerate(ROTATION_COLUMNS)},
        }


def _slerp(
    q0: NDArray[np.float64], q1: NDArray[np.float64], alpha: NDArray[np.float64]
) -> NDArray[np.float64]:
    # Neighbours share a sign (see __init__), so the dot product is never negative.
    angle = np.arccos(np.clip(np.sum(q0 * q1, axis=-1, keepdims=True), -1.0, 1.0))
    small = angle < 1e-6
    sine = np.where(small, 1.0, np.sin(angle))
    w0 = np.where(small, 1 - alpha, np.sin((1 - alpha) * angle) / sine)
    w1 = np.where(small, alpha, np.sin(alpha * angle) / sine)
    return w0 * q0 + w1 * q1
