"""LiDAR topics to bursts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from card.recording.bag.cloud import points_of_cloud
from card.recording.bag.messages import nanoseconds
from card.recording.bag.source import Source
from card.recording.burst import Burst
from card.recording.clock import SensorClock
from card.recording.hesai.angles import ChannelAngles
from card.recording.hesai.decode import Columns, columns_of
from card.recording.hesai.packet import parse_packets
from card.recording.hesai.scans import burst_of, whole_scans


@dataclass
class PacketCount:
    """Packets seen and packets missing from the UDP sequence."""

    packets: int = 0
    lost: int = 0
    last: int | None = None

    def add(self, sequence: npt.NDArray[np.uint32]) -> None:
        """Count a message's packets by their (N,) sequence numbers, which wrap at 2^32."""
        before = [] if self.last is None else [self.last]
        numbers = np.concatenate([before, sequence]).astype(np.int64)
        steps = (numbers[1:] - numbers[:-1]) & 0xFFFFFFFF
        # A step of half the range or more is a packet that came late: it is not lost.
        self.lost += int((steps[(steps > 0) & (steps < 2**31)] - 1).sum())
        self.packets += len(sequence)
        self.last = int(sequence[-1])


def packets_of(scan: Any, where: object) -> tuple[npt.NDArray[np.void], npt.NDArray[np.int64]]:
    """A PandarScan -> (its parsed packets, (N,) host stamps in ns)."""
    packets = parse_packets([packet.data[: packet.size] for packet in scan.packets], where)
    return packets, np.array([nanoseconds(packet.stamp) for packet in scan.packets], dtype=np.int64)


def packet_bursts(
    source: Source,
    angles: ChannelAngles,
    column_period_ns: int,
    clock: SensorClock | None,
    count: PacketCount,
) -> Iterator[Burst]:
    """The whole scans of a topic of packets, on the host's clock where `clock` is given.

    Keeps one scan in memory; `count` is brought up to date as packets pass.
    """

    def columns() -> Iterator[Columns]:
        for index, (message, _) in enumerate(source.messages()):
            where = f"{source.where}, message {index}"
            packets, _ = packets_of(message, where)
            if not len(packets):
                continue
            count.add(packets["sequence"])
            chunk = columns_of(packets, column_period_ns, where)
            time_ns = clock.to_host(chunk.time_ns) if clock else chunk.time_ns
            yield Columns(chunk.azimuth, time_ns, chunk.distance, chunk.reflectivity)

    for scan in whole_scans(columns()):
        yield burst_of(scan, angles)


def cloud_bursts(source: Source, clock: SensorClock | None) -> Iterator[Burst]:
    """A burst for each cloud of a topic; clouds without returns are left out."""
    for index, (message, _) in enumerate(source.messages()):
        points = points_of_cloud(message, f"{source.where}, message {index}")
        if not len(points.points):
            continue
        time_ns = clock.to_host(points.time_ns) if clock else points.time_ns
        t_ns = int(time_ns[0])
        # Too long for a burst is for write_burst to refuse; here it must only not wrap around.
        offset = np.minimum(time_ns - t_ns, 2**32 - 1).astype(np.uint32)
        yield Burst(t_ns, points.points, points.intensity, points.ring, offset)
