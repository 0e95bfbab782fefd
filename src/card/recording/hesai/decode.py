"""Packets to columns, columns to points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.recording.hesai.angles import ChannelAngles
from card.recording.hesai.packet import (
    BLOCKS,
    CHANNEL_OFFSET_NS,
    CHANNELS,
    DISTANCE_UNIT_M,
    DUAL_RETURN,
    block_offset_ns,
    packet_time_ns,
)


@dataclass(frozen=True)
class Columns:
    """Rounds of firing in order of time: C columns of R returns (1 or 2) of 32 channels.

    azimuth: (C,) int64, rotor, hundredths of a degree, 0 to 35,999.
    time_ns: (C,) int64, start of the round, on the clock the packets' times are on.
    distance: (C, R, 32) uint16 in units of 4 mm, 0 is no return.
    reflectivity: (C, R, 32) uint8.
    """

    azimuth: npt.NDArray[np.int64]
    time_ns: npt.NDArray[np.int64]
    distance: npt.NDArray[np.uint16]
    reflectivity: npt.NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.azimuth)

    def __getitem__(self, part: slice) -> Columns:
        return Columns(self.azimuth[part], self.time_ns[part], self.distance[part], self.reflectivity[part])


@dataclass(frozen=True)
class Points:
    """Returns of some columns, in order of column, channel, return.

    points: (N, 3) float64 metres in the sensor frame; ring, intensity: (N,) uint8;
    time_ns: (N,) int64, the moment of each shot.
    """

    points: npt.NDArray[np.float64]
    intensity: npt.NDArray[np.uint8]
    ring: npt.NDArray[np.uint8]
    time_ns: npt.NDArray[np.int64]


def columns_of(packets: npt.NDArray[np.void], column_period_ns: int, where: object) -> Columns:
    """Parsed packets (see `parse_packets`), all of one return mode -> their columns.

    Raises CardError when the return mode changes.
    """
    dual_of = packets["return_mode"] == DUAL_RETURN
    if dual_of.any() != dual_of.all():
        index = int(np.flatnonzero(dual_of != dual_of[0])[0])
        raise CardError(
            "return mode changes", where=f"{where}, packet {index}", wanted="one mode a recording"
        )
    returns = 2 if len(packets) and dual_of[0] else 1
    shape = (len(packets) * BLOCKS // returns, returns, CHANNELS)
    blocks = packets["blocks"]
    time_ns = packet_time_ns(packets)[:, None] + block_offset_ns(returns == 2, column_period_ns)
    return Columns(
        azimuth=blocks["azimuth"][:, ::returns].reshape(-1).astype(np.int64),
        time_ns=time_ns[:, ::returns].reshape(-1),
        distance=blocks["returns"]["distance"].reshape(shape),
        reflectivity=blocks["returns"]["reflectivity"].reshape(shape),
    )


def points_of(columns: Columns, angles: ChannelAngles) -> Points:
    """The returns of `columns` as points.

    x = r cos(el) sin(az), y = r cos(el) cos(az), z = r sin(el), azimuth of rotor and channel added.
    The second of two returns that are the same is dropped: the sensor repeats a lone return.
    """
    valid = columns.distance > 0
    if valid.shape[1] == 2:
        valid[:, 1] &= columns.distance[:, 1] != columns.distance[:, 0]
    # (C, 32, R), so that points come out in the order in which they were shot.
    column, ring, order = np.nonzero(valid.transpose(0, 2, 1))
    r = columns.distance[column, order, ring] * DISTANCE_UNIT_M
    azimuth = np.radians(columns.azimuth[column] / 100.0) + angles.azimuth_rad[ring]
    level = r * np.cos(angles.elevation_rad[ring])
    return Points(
        points=np.column_stack(
            [level * np.sin(azimuth), level * np.cos(azimuth), r * np.sin(angles.elevation_rad[ring])]
        ),
        intensity=columns.reflectivity[column, order, ring],
        ring=ring.astype(np.uint8),
        time_ns=columns.time_ns[column] + CHANNEL_OFFSET_NS[ring],
    )
