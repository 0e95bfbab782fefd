"""Whether a delivered trajectory can be that of a car."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import inverse, matrix_from_quaternion, quaternion_from_matrix
from card.poses.anchor import tilt_deg

Array = NDArray[np.float64]
Times = NDArray[np.int64]
#: Steps on either side that say how fast the car was; a jump is judged against their median.
NEIGHBOURS = 5


def check_upright(
    delivered_from_sensor: Array, rig_from_sensor: Array, up: Array, max_tilt_deg: float, where: object
) -> None:
    """The rig stands upright most of the time.

    Raises
    ------
    CardError
        Naming the cause that explains it: quaternions stored w first, or another frame or up axis.
    """
    median = _median_tilt(delivered_from_sensor, rig_from_sensor, up)
    if median <= max_tilt_deg:
        return
    quaternion = quaternion_from_matrix(delivered_from_sensor[:, :3, :3])
    swapped = delivered_from_sensor.copy()
    # What was read as (x, y, z, w) was written as (w, x, y, z).
    swapped[:, :3, :3] = matrix_from_quaternion(quaternion[:, [1, 2, 3, 0]])
    if _median_tilt(swapped, rig_from_sensor, up) <= max_tilt_deg:
        raise CardError(
            "quaternions are stored w first", where=where, found="qw qx qy qz", wanted="qx qy qz qw"
        )
    raise CardError(
        "rig is not upright: wrong frame or up axis",
        where=where,
        found=f"median tilt {median:.0f} deg",
        wanted=f"at most {max_tilt_deg:g} deg",
    )


def check_motion(
    t_ns: Times, position: Array, settings: Mapping[str, Any], where: object
) -> dict[str, float]:
    """No gap, no impossible speed, no jump; returns ``max_gap_s`` and ``max_speed_m_s``.

    Parameters
    ----------
    t_ns, position : (N,) ns and (N, 3) metres of the rig.

    Raises
    ------
    CardError
        Naming the time of the first violation.
    """
    seconds = np.diff(t_ns) / 1e9
    _refuse(
        seconds > settings["max_gap_s"],
        t_ns,
        seconds,
        where,
        "gap in the trajectory",
        "s",
        settings["max_gap_s"],
    )
    velocity = np.diff(position, axis=0) / seconds[:, None]
    usual = _running_median(velocity)
    jump = np.linalg.norm(velocity - usual, axis=1) * seconds
    _refuse(jump > settings["max_jump_m"], t_ns, jump, where, "trajectory jumps", "m", settings["max_jump_m"])
    speed = np.linalg.norm(usual, axis=1)
    _refuse(
        speed > settings["max_speed_m_s"],
        t_ns,
        speed,
        where,
        "impossible speed (unit of length or time?)",
        "m/s",
        settings["max_speed_m_s"],
    )
    return {"max_gap_s": float(seconds.max()), "max_speed_m_s": float(speed.max())}


def check_coverage(
    covered: tuple[int, int], wanted: Mapping[str, tuple[Times, Times]], where: object
) -> None:
    """Every burst and image lies within the trajectory.

    Parameters
    ----------
    covered : first and last time, ns.
    wanted : sensor to its members' numbers (M,) and times (M,) or (M, 2) of start and end, ns.

    Raises
    ------
    CardError
        Listing the members of each sensor that are not covered.
    """
    missing = []
    for sensor, (numbers, times) in wanted.items():
        spans = times.reshape(len(numbers), -1)
        outside = (spans.min(axis=1) < covered[0]) | (spans.max(axis=1) > covered[1])
        if outside.any():
            missing.append(f"{sensor} {ranges(numbers[outside])}")
    if missing:
        raise CardError(
            "trajectory does not cover all bursts and images",
            where=where,
            found=f"{covered[0]}..{covered[1]} ns without " + ", ".join(missing),
        )


def ranges(numbers: Times) -> str:
    """Increasing whole numbers as text: ``0-3, 7``."""
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    runs = np.split(numbers, breaks)
    return ", ".join(f"{run[0]}" if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def _median_tilt(delivered_from_sensor: Array, rig_from_sensor: Array, up: Array) -> float:
    return float(np.median(tilt_deg(delivered_from_sensor @ inverse(rig_from_sensor), up)))


def _running_median(velocity: Array) -> Array:
    width = min(2 * NEIGHBOURS + 1, len(velocity))
    padded = np.pad(velocity, ((width // 2, (width - 1) // 2), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=0)
    return np.asarray(np.median(windows, axis=-1))


def _refuse(
    wrong: NDArray[np.bool_], t_ns: Times, values: Array, where: object, what: str, unit: str, limit: float
) -> None:
    if wrong.any():
        i = int(np.argmax(wrong))
        raise CardError(
            what,
            where=f"{where} after {t_ns[i]} ns",
            found=f"{values[i]:.3g} {unit}",
            wanted=f"<= {limit:g} {unit}",
        )
