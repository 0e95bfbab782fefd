"""The PandarXT-32 point cloud packet: fields, checks, times.

Layout and firing times follow the sensor's user manual (UDP data; absolute time and laser firing
time) and the manufacturer's driver. A packet holds eight blocks of 32 channels; in dual return mode
two neighbouring blocks belong to one round of firing: first the last return, then the strongest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from card.errors import CardError

PACKET_BYTES = 1080
BLOCKS = 8
CHANNELS = 32
DISTANCE_UNIT_M = 0.004
AZIMUTH_UNITS = 36_000  # hundredths of a degree in a turn
SINGLE_RETURN = (0x37, 0x38)  # strongest, last
DUAL_RETURN = 0x39

#: Time between rounds of firing of the real sensor; 2,000 rounds a turn at 600 rpm.
COLUMN_PERIOD_NS = 50_000
# The packet's time is that of the command that triggers its last round of firing.
_TRIGGER_TO_ROUND_NS = 5_632
#: Nanoseconds from the start of a round to each channel's shot, (32,).
CHANNEL_OFFSET_NS: npt.NDArray[np.int64] = 368 + 1_512 * np.arange(CHANNELS, dtype=np.int64)

_RETURN = np.dtype([("distance", "<u2"), ("reflectivity", "u1"), ("reserved", "u1")])
_BLOCK = np.dtype([("azimuth", "<u2"), ("returns", _RETURN, (CHANNELS,))])
PACKET = np.dtype(
    [
        ("start", "u1", (2,)),
        ("protocol", "u1", (2,)),
        ("reserved_header", "u1", (2,)),
        ("channels", "u1"),
        ("blocks_in_packet", "u1"),
        ("first_return", "u1"),
        ("distance_unit_mm", "u1"),
        ("returns_of_channel", "u1"),
        ("flags", "u1"),
        ("blocks", _BLOCK, (BLOCKS,)),
        ("reserved_tail", "u1", (10,)),
        ("return_mode", "u1"),
        ("motor_rpm", "<u2"),
        ("utc", "u1", (6,)),
        ("microseconds", "<u4"),
        ("factory", "u1"),
        ("sequence", "<u4"),
    ]
)
assert PACKET.itemsize == PACKET_BYTES

_WANTED = {
    "start": [0xEE, 0xFF],
    "protocol": [6, 1],
    "channels": CHANNELS,
    "blocks_in_packet": BLOCKS,
    "distance_unit_mm": 4,
}


def parse_packets(data: Sequence[bytes | memoryview | np.ndarray], where: object) -> npt.NDArray[np.void]:
    """Packets as they came over UDP -> (N,) array of dtype `PACKET`.

    Raises CardError, naming `where` and the packet, for anything that is no XT32 packet.
    """
    for index, packet in enumerate(data):
        if len(packet) != PACKET_BYTES:
            raise CardError(
                "packet of a wrong size",
                where=f"{where}, packet {index}",
                found=f"{len(packet)} bytes",
                wanted=f"{PACKET_BYTES} bytes (PandarXT-32)",
            )
    packets = np.frombuffer(b"".join(bytes(p) for p in data), dtype=PACKET)
    for field, wanted in _WANTED.items():
        differs = (packets[field].reshape(len(packets), -1) != np.array(wanted)).any(axis=1)
        _refuse(differs, packets, field, wanted, where)
    modes = (*SINGLE_RETURN, DUAL_RETURN)
    _refuse(~np.isin(packets["return_mode"], modes), packets, "return_mode", [hex(m) for m in modes], where)
    beyond = np.any(packets["blocks"]["azimuth"] >= AZIMUTH_UNITS, axis=1)
    _refuse(beyond, packets["blocks"], "azimuth", f"below {AZIMUTH_UNITS} hundredths of a degree", where)
    return packets


def packet_time_ns(packets: npt.NDArray[np.void]) -> npt.NDArray[np.int64]:
    """(N,) int64, each packet's time on the sensor's clock, ns since 1970 as its UTC fields say."""
    year, month, day, hour, minute, second = packets["utc"].astype(np.int64).T
    months = (year - 70) * 12 + (month - 1)
    days = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) + day - 1
    seconds = days * 86_400 + hour * 3_600 + minute * 60 + second
    return seconds * 1_000_000_000 + packets["microseconds"].astype(np.int64) * 1_000


def block_offset_ns(dual: bool, column_period_ns: int) -> npt.NDArray[np.int64]:
    """(8,) int64, from the packet's time to the start of each block's round of firing."""
    rounds = np.arange(BLOCKS) // (2 if dual else 1)
    return _TRIGGER_TO_ROUND_NS - column_period_ns * (rounds[-1] - rounds).astype(np.int64)


def _refuse(
    bad: np.ndarray, packets: npt.NDArray[np.void], field: str, wanted: object, where: object
) -> None:
    if bad.any():
        index = int(np.flatnonzero(bad)[0])
        raise CardError(
            f"packet with an unknown {field}",
            where=f"{where}, packet {index}",
            found=packets[field][index].tolist(),
            wanted=wanted,
        )
