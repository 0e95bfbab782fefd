"""Columns to packets: what a sensor in single return mode would have sent."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.recording.hesai.decode import Columns
from card.recording.hesai.packet import (
    AZIMUTH_UNITS,
    BLOCKS,
    CHANNELS,
    DISTANCE_UNIT_M,
    PACKET,
    SINGLE_RETURN,
    block_offset_ns,
)

# A packet carries one time for its eight columns, in whole microseconds.
_TIME_TOLERANCE_NS = 1_000


def quantise_columns(
    azimuth_rad: npt.NDArray[np.float64],
    time_ns: npt.NDArray[np.int64],
    range_m: npt.NDArray[np.float64],
    reflectivity: npt.NDArray[np.uint8],
) -> Columns:
    """Measurements -> columns in the sensor's units.

    azimuth_rad: (C,) rotor; time_ns: (C,) start of each round of firing; range_m: (C, 32), anything
    that is not finite, not positive or out of the 262 m that fit is no return; reflectivity: (C, 32).
    """
    units = np.nan_to_num(range_m / DISTANCE_UNIT_M, nan=0.0, posinf=0.0, neginf=0.0)
    distance = np.where((units >= 0.5) & (units < 65_535.5), np.rint(units), 0)
    return Columns(
        azimuth=np.rint(np.degrees(azimuth_rad) * 100).astype(np.int64) % AZIMUTH_UNITS,
        time_ns=np.asarray(time_ns, dtype=np.int64),
        distance=distance.astype(np.uint16)[:, None, :],
        reflectivity=np.asarray(reflectivity, dtype=np.uint8)[:, None, :],
    )


def encode_packets(
    columns: Columns, *, column_period_ns: int, motor_rpm: int = 600, first_sequence: int = 1
) -> npt.NDArray[np.void]:
    """Columns of a single return, `column_period_ns` apart -> (N,) array of dtype `PACKET`.

    A last packet that is not full is filled with columns without returns.
    Raises CardError for dual returns or where columns of one packet are not evenly spaced.
    """
    if columns.distance.shape[1:] != (1, CHANNELS):
        raise CardError("only single returns are encoded", found=columns.distance.shape, wanted="(C, 1, 32)")
    count = -(-len(columns) // BLOCKS)
    columns = _filled(columns, count * BLOCKS, column_period_ns)
    offset = block_offset_ns(False, column_period_ns)
    time_ns = columns.time_ns.reshape(count, BLOCKS) - offset
    uneven = np.abs(time_ns - time_ns[:, -1:]) > _TIME_TOLERANCE_NS
    if uneven.any():
        raise CardError(
            "columns of a packet are not evenly spaced",
            where=f"packet {int(np.flatnonzero(uneven.any(axis=1))[0])}",
            wanted=f"{column_period_ns} ns apart",
        )
    packets = np.zeros(count, dtype=PACKET)
    packets["start"] = (0xEE, 0xFF)
    packets["protocol"] = (6, 1)
    packets["channels"] = CHANNELS
    packets["blocks_in_packet"] = BLOCKS
    packets["distance_unit_mm"] = 4
    packets["returns_of_channel"] = 1
    packets["flags"] = 1
    packets["blocks"]["azimuth"] = columns.azimuth.reshape(count, BLOCKS)
    shape = (count, BLOCKS, CHANNELS)
    packets["blocks"]["returns"]["distance"] = columns.distance.reshape(shape)
    packets["blocks"]["returns"]["reflectivity"] = columns.reflectivity.reshape(shape)
    packets["return_mode"] = SINGLE_RETURN[0]
    packets["motor_rpm"] = motor_rpm
    packets["factory"] = 0x42
    packets["sequence"] = first_sequence + np.arange(count)
    microseconds = (time_ns[:, -1] + 500) // 1_000
    packets["microseconds"] = microseconds % 1_000_000
    packets["utc"] = _utc_bytes(microseconds // 1_000_000)
    return packets


def _filled(columns: Columns, length: int, period_ns: int) -> Columns:
    missing = length - len(columns)
    if not missing:
        return columns
    ahead = np.arange(1, missing + 1)
    step = int(columns.azimuth[-1] - columns.azimuth[-2]) if len(columns) > 1 else 1
    empty = np.zeros((missing, 1, CHANNELS))
    return Columns(
        azimuth=np.concatenate([columns.azimuth, (columns.azimuth[-1] + step * ahead) % AZIMUTH_UNITS]),
        time_ns=np.concatenate([columns.time_ns, columns.time_ns[-1] + period_ns * ahead]),
        distance=np.concatenate([columns.distance, empty.astype(np.uint16)]),
        reflectivity=np.concatenate([columns.reflectivity, empty.astype(np.uint8)]),
    )


def _utc_bytes(seconds: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
    """(N,) seconds since 1970 -> (N, 6): year since 1900, month, day, hour, minute, second."""
    moment = seconds.astype("datetime64[s]")
    month = moment.astype("datetime64[M]")
    day = (moment.astype("datetime64[D]") - month.astype("datetime64[D]")).astype(np.int64) + 1
    months = month.astype(np.int64)
    clock = seconds % 86_400
    fields = [months // 12 + 70, months % 12 + 1, day, clock // 3_600, clock // 60 % 60, clock % 60]
    return np.column_stack(fields).astype(np.uint8)
