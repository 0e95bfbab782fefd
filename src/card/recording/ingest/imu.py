"""Does the IMU cover the drive, in the units it should be in?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts import read_table
from card.errors import CardError


def check_imu(path: Path, settings: Mapping[str, Any]) -> npt.NDArray[np.int64]:
    """(N,) int64, the times of the IMU's measurements in ns.

    Raises CardError for a table that does not fit schema ``imu`` (times that go back included), has
    no rows, or whose values are in other units than rad/s and m/s^2.
    """
    table = read_table(path, "imu")
    if not table.num_rows:
        raise CardError("no IMU measurements", where=path)
    gyro, accel = (
        np.column_stack([table[f"{name}_{axis}"].to_numpy() for axis in "xyz"]) for name in ("gyro", "accel")
    )
    fastest = float(np.linalg.norm(gyro, axis=1).max())
    if fastest > settings["gyro_max_rad_s"]:
        raise CardError(
            "angular rates are not in rad/s",
            where=path,
            found=f"up to {fastest:.1f}",
            wanted=f"at most {settings['gyro_max_rad_s']:g} rad/s",
        )
    gravity = float(np.linalg.norm(accel.mean(axis=0)))
    lowest, highest = settings["gravity_range_m_s2"]
    if not lowest <= gravity <= highest:
        raise CardError(
            "specific forces are not in m/s^2, or without gravity",
            where=path,
            found=f"mean of norm {gravity:.2f}",
            wanted=f"{lowest:g} to {highest:g} m/s^2",
        )
    times: npt.NDArray[np.int64] = table["t_ns"].to_numpy()
    return times
