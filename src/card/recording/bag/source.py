"""One topic of a bag as a stream of messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.errors import CardError
from card.recording.bag.messages import CLOUD, COMPRESSED_IMAGE, IMAGE, IMU, PACKETS, typestore
from card.recording.paths import CAMERAS, LIDARS

_WANTED = (
    dict.fromkeys(CAMERAS, (IMAGE, COMPRESSED_IMAGE))
    | dict.fromkeys(LIDARS, (PACKETS, CLOUD))
    | {"imu": (IMU,)}
)


@dataclass(frozen=True)
class Source:
    """The messages of one sensor.

    where: bag and topic, for errors; kind: the message type; count: how many messages.
    """

    sensor: str
    where: str
    kind: str
    count: int
    _reader: Any
    _connections: tuple[Any, ...]

    def messages(self) -> Iterator[tuple[Any, int]]:
        """Messages with the time at which the host recorded them, ns, in that order.

        Raises CardError for a message that cannot be read, or when there are fewer or more of them
        than the bag says.
        """
        store = typestore()
        stream = self._reader.messages(connections=self._connections)
        read = 0
        while True:
            try:
                _, host_ns, raw = next(stream)
                message = store.deserialize_cdr(raw, self.kind)
            except StopIteration:
                break
            # The storage plugins let the errors of the libraries under them through.
            except Exception as error:
                where = f"{self.where}, message {read}"
                raise CardError("unreadable message", where=where, found=error, wanted=self.kind) from error
            read += 1
            yield message, host_ns
        if read != self.count:
            raise CardError("bag is not whole", where=self.where, found=f"{read} messages", wanted=self.count)


@contextmanager
def open_bag(folder: Path, topics: dict[str, str]) -> Iterator[list[Source]]:
    """Open the bag in `folder`; one source for each sensor of `topics` {sensor: topic}.

    Raises CardError for a folder that is no bag, a topic that is not in it, or one that carries a
    message type its sensor cannot have.
    """
    from rosbags.rosbag2 import Reader, ReaderError

    try:
        reader = Reader(folder)
        reader.open()
    except (ReaderError, OSError) as error:
        raise CardError("unreadable bag", where=folder, found=error, wanted="a rosbag2 folder") from error
    try:
        yield [_source(folder, reader, sensor, topic) for sensor, topic in sorted(topics.items())]
    finally:
        reader.close()


def _source(folder: Path, reader: Any, sensor: str, topic: str) -> Source:
    connections = tuple(c for c in reader.connections if c.topic == topic)
    where = f"{folder}, topic {topic}"
    if not connections:
        raise CardError(
            f"no topic of {sensor} in the bag", where=where, found=sorted(c.topic for c in reader.connections)
        )
    kinds = {c.msgtype for c in connections}
    if len(kinds) > 1 or not kinds <= set(_WANTED[sensor]):
        raise CardError(
            f"wrong message type for {sensor}",
            where=where,
            found=sorted(kinds),
            wanted=f"one of {', '.join(_WANTED[sensor])}",
        )
    return Source(sensor, where, kinds.pop(), sum(c.msgcount for c in connections), reader, connections)
