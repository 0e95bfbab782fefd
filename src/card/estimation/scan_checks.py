"""Whether IMU and scans belong together, before anything is built on them: units, axes, clocks, gaps."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.errors import CardError
from card.estimation.imu import Imu
from card.estimation.imu_checks import (
    accel_cause,
    accel_unit_cause,
    clock_offset,
    gyro_cause,
    integrated_gyro,
    windows_of,
)
from card.estimation.lidar_only import scan_trajectory
from card.estimation.odometry import covered_sweeps
from card.estimation.plane_map import PlaneSettings
from card.estimation.scans import Sweeps

#: Angle between mean specific force and the rig's z above which no car stands or drives, deg.
MAX_TILT_DEG = 45.0
#: An offset of the clocks must exceed its limit by this many of its standard deviations.
SURE_SIGMAS = 3.0
#: An offset is believed if with it IMU and scans differ so many times less than without.
CLEARER = 2.0


def check_imu(imu: Imu, max_gap_s: float, where: Path) -> None:
    """No gap, gravity in m/s^2 along the rig's z.

    Raises
    ------
    CardError
        Naming what is wrong and where.
    """
    gaps = np.diff(imu.t_ns) * 1e-9
    if gaps.max() > max_gap_s:
        i = int(np.argmax(gaps > max_gap_s))
        raise CardError(
            "gap in the IMU",
            where=f"{where} after {imu.t_ns[i]} ns",
            found=f"{gaps[i]:.3g} s",
            wanted=f"<= {max_gap_s:g} s",
        )
    if cause := accel_unit_cause(imu):
        raise CardError(cause[0], where=where, wanted="m/s^2")
    force = imu.accel.mean(axis=0)
    tilt = float(np.degrees(np.arccos(force[2] / np.linalg.norm(force))))
    if tilt > MAX_TILT_DEG:
        strongest = int(np.argmax(np.abs(force)))
        raise CardError(
            "gravity does not act along the rig's z: axes of the accelerometer are swapped",
            where=where,
            found=f"mean specific force along {'-' if force[strongest] < 0 else ''}{'xyz'[strongest]}",
            wanted="z",
        )


def check_against_scans(
    scans: Sweeps, imu: Imu, settings: Any, planes: PlaneSettings, where: Path
) -> tuple[list[Figure], list[str]]:
    """Figures of agreement between the IMU and scans alone where the car turns most, and notes.

    Raises
    ------
    CardError
        If another unit or order of axes explains the IMU much better, or the clocks differ.
    """
    offset_ms = sigma_ms = error_deg = None
    notes = []
    chosen = _liveliest(scans, imu, settings["check_s"])
    try:
        _, path = scan_trajectory([scans[i] for i in chosen], settings["scan_leaf_m"], planes)
    except CardError as error:
        notes.append(f"IMU and scans could not be compared: {error}")
    else:
        windows = windows_of(imu, path, settings["imu_window_s"])
        if windows.turns:
            offset_ms, sigma_ms = (1e3 * value for value in clock_offset(imu, windows))
            shifted = integrated_gyro(imu, windows.edges_ns, 1e-3 * offset_ms)
            error_deg = _median_deg(shifted - windows.rotated)
            plain_deg = _median_deg(integrated_gyro(imu, windows.edges_ns, 0.0) - windows.rotated)
            causes = gyro_cause(imu, windows) + accel_cause(imu, path, windows.edges_ns)
            if causes:
                raise CardError(
                    "IMU and scans tell of different motions", where=where, found="; ".join(causes)
                )
            differ = abs(offset_ms) - SURE_SIGMAS * sigma_ms > settings["max_clock_offset_ms"]
            if differ and error_deg * CLEARER > plain_deg:
                notes.append("scans alone are too poor where the car turns most to compare the clocks")
                offset_ms, sigma_ms, error_deg = None, None, plain_deg
            elif differ:
                raise CardError(
                    "clocks of LiDAR and IMU differ",
                    where=where,
                    found=f"the IMU's is {offset_ms:.1f} ms ahead",
                    wanted=f"at most {settings['max_clock_offset_ms']:g} ms",
                )
        else:
            notes.append("the car turns too little to compare the clocks and axes of LiDAR and IMU")
    figures = [
        Figure("clock_offset_ms", offset_ms, "ms", "by how much the IMU's clock is ahead of the LiDAR's"),
        Figure("clock_offset_sigma_ms", sigma_ms, "ms", "standard deviation of that offset"),
        Figure(
            "scan_gyro_error_deg",
            error_deg,
            "deg",
            f"median difference of gyro and scans alone over {settings['imu_window_s']:g} s at that offset",
        ),
    ]
    return figures, notes


def _median_deg(rotations: NDArray[np.float64]) -> float:
    """Median size, deg, of rotation vectors (N, 3) in rad."""
    return float(np.degrees(np.median(np.linalg.norm(rotations, axis=1))))


def _liveliest(scans: Sweeps, imu: Imu, seconds: float) -> list[int]:
    """Sweeps of one LiDAR, `seconds` long, during which the gyro varies most."""
    covered = covered_sweeps(scans, imu)
    mine = covered[scans.lidar[covered] == scans.lidar[covered[0]]]
    square = np.sum((imu.gyro - np.median(imu.gyro, axis=0)) ** 2, axis=1)
    total = np.concatenate([[0.0], np.cumsum(square)])
    start, end = scans.end_ns[mine], scans.end_ns[mine] + round(seconds * 1e9)
    energy = total[np.searchsorted(imu.t_ns, end)] - total[np.searchsorted(imu.t_ns, start)]
    best = int(np.argmax(np.where(end <= start[-1], energy, -1.0))) if end[0] <= start[-1] else 0
    return [int(i) for i in mine[best:] if scans.end_ns[i] <= end[best]]
