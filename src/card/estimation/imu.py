"""Inertial measurements between any two times, and what is known of their errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.errors import CardError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Imu:
    """IMU samples: t_ns (N,), gyro (N, 3) rad/s and accel (N, 3) m/s^2 (specific force), in rig axes."""

    t_ns: NDArray[np.int64]
    gyro: Array
    accel: Array

    def between(self, start_ns: int, end_ns: int) -> "Imu":
        """The samples within a span, with interpolated ones at both of its ends.

        Raises
        ------
        CardError
            If the samples do not cover the span: nothing is extrapolated.
        """
        if start_ns < self.t_ns[0] or end_ns > self.t_ns[-1]:
            raise CardError(
                "IMU does not cover a requested time",
                found=f"IMU {self.t_ns[0]}..{self.t_ns[-1]} ns",
                wanted=f"{start_ns}..{end_ns} ns",
            )
        first = int(np.searchsorted(self.t_ns, start_ns, side="right"))
        last = int(np.searchsorted(self.t_ns, end_ns, side="left"))
        t_ns = np.concatenate([[start_ns], self.t_ns[first:last], [end_ns]])
        # Relative to a near time: float64 holds nanoseconds since 1970 only to some hundred.
        low, high = max(first - 1, 0), min(last + 1, len(self.t_ns))
        known = (self.t_ns[low:high] - start_ns).astype(np.float64)
        wanted = (t_ns - start_ns).astype(np.float64)
        gyro, accel = (
            np.stack([np.interp(wanted, known, values[low:high, axis]) for axis in range(3)], axis=1)
            for values in (self.gyro, self.accel)
        )
        return Imu(t_ns, gyro, accel)

    def backwards(self) -> "Imu":
        """The samples from the last to the first."""
        return Imu(self.t_ns[::-1], self.gyro[::-1], self.accel[::-1])

    def corrected(self, gyro_matrix: ArrayLike, accel_matrix: ArrayLike) -> "Imu":
        """The samples of a unit without errors of scale and axes: matrices (3, 3) times what was measured."""
        return Imu(self.t_ns, self.gyro @ np.transpose(gyro_matrix), self.accel @ np.transpose(accel_matrix))

    def without(self, gyro_bias: Array, accel_bias: Array) -> "Imu":
        """The samples less biases (3,) or, one a sample, (N, 3)."""
        return Imu(self.t_ns, self.gyro - gyro_bias, self.accel - accel_bias)


@dataclass(frozen=True)
class ImuNoise:
    """White noise densities and bias random walks, SI per root Hz, one sigma of the biases at the start."""

    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float
    gyro_bias: float
    accel_bias: float

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> "ImuNoise":
        """From settings whose names are those of the fields."""
        return cls(**{name: float(settings[name]) for name in cls.__dataclass_fields__})


def read_imu(
    table: Any,
    corrections: Mapping[str, Any] | None,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Imu:
    """The samples of a table of schema ``imu``, all or those within a span of time.

    corrections : ``imu_corrections`` of the calibration, which are applied; None if they are not known.

    Raises
    ------
    CardError
        If there is none.
    """
    column = {name: np.asarray(table[name]) for name in ("t_ns", *_names("gyro"), *_names("accel"))}
    inside = np.ones(len(column["t_ns"]), dtype=bool)
    if start_ns is not None:
        inside &= column["t_ns"] >= start_ns
    if end_ns is not None:
        inside &= column["t_ns"] <= end_ns
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
    measured = Imu(column["t_ns"][inside], gyro, accel)
    return measured if corrections is None else measured.corrected(corrections["gyro"], corrections["accel"])


def _names(kind: str) -> list[str]:
    return [f"{kind}_{axis}" for axis in "xyz"]
