"""How the stamps of a topic relate to the host's clock."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.recording.bag.bursts import packets_of
from card.recording.bag.cloud import points_of_cloud
from card.recording.bag.messages import CLOUD, PACKETS, nanoseconds
from card.recording.bag.source import Source
from card.recording.clock import SensorClock, fit_clock
from card.recording.hesai.packet import packet_time_ns


def relate_clock(source: Source) -> SensorClock:
    """Fit the clock of a topic: one pass over its messages.

    The host's stamp is that of each packet for packets, else that of the message in the bag.
    Raises CardError for a topic without messages.
    """
    pairs = [
        _pairs(source, message, host_ns, f"{source.where}, message {index}")
        for index, (message, host_ns) in enumerate(source.messages())
    ]
    if not sum(len(sensor_ns) for sensor_ns, _ in pairs):
        raise CardError("no messages", where=source.where, wanted=f"data of {source.sensor}")
    return fit_clock(np.concatenate([pair[0] for pair in pairs]), np.concatenate([pair[1] for pair in pairs]))


def check_synchronised(source: Source, clock: SensorClock, tolerance_ns: int) -> None:
    """Raises CardError when a sensor that is said to be synchronised is further off than messages take."""
    if abs(clock.offset_ns) > tolerance_ns:
        raise CardError(
            f"{source.sensor} is not synchronised",
            where=source.where,
            found=f"its stamps are {clock.offset_ns / 1e9:.3f} s behind the host's",
            wanted=f"at most {tolerance_ns / 1e9:g} s, or clock: free_running in recording.yaml",
        )


def _pairs(
    source: Source, message: Any, host_ns: int, where: str
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    if source.kind == PACKETS:
        packets, stamps = packets_of(message, where)
        return packet_time_ns(packets), stamps
    if source.kind == CLOUD:
        last = points_of_cloud(message, where).time_ns[-1:]
        return last, np.full(len(last), host_ns, dtype=np.int64)
    return np.array([nanoseconds(message.header.stamp)]), np.array([host_ns])
