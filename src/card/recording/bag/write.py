"""Writing bags: what a car that records with ROS 2 would leave."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from card.recording.bag.messages import COMPRESSED_IMAGE, IMU, PACKET_CAPACITY, PACKETS, typestore
from card.recording.hesai.packet import PACKET_BYTES


class BagWriter:
    """Messages into an open bag; see `write_bag`. Times are nanoseconds on the host's clock."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._types = typestore().types
        self._connections: dict[str, Any] = {}

    def packets(self, topic: str, packets: npt.NDArray[np.void], host_ns: npt.NDArray[np.int64]) -> None:
        """One PandarScan: (N,) packets of dtype `PACKET` and (N,) stamps of their arrival."""
        packet = self._types["pandar_msgs/msg/PandarPacket"]
        padding = np.zeros(PACKET_CAPACITY - PACKET_BYTES, dtype=np.uint8)
        scan = self._types[PACKETS](
            header=self._header(int(host_ns[0]), topic),
            packets=[
                packet(
                    stamp=self._time(int(stamp)),
                    data=np.concatenate([np.frombuffer(one.tobytes(), dtype=np.uint8), padding]),
                    size=PACKET_BYTES,
                )
                for one, stamp in zip(packets, host_ns, strict=True)
            ],
        )
        self._write(topic, PACKETS, int(host_ns[-1]), scan)

    def image(self, topic: str, t_ns: int, jpeg: bytes) -> None:
        """One CompressedImage taken at `t_ns`."""
        data = np.frombuffer(jpeg, dtype=np.uint8)
        message = self._types[COMPRESSED_IMAGE](header=self._header(t_ns, topic), format="jpeg", data=data)
        self._write(topic, COMPRESSED_IMAGE, t_ns, message)

    def imu(
        self, topic: str, t_ns: int, gyro: npt.NDArray[np.float64], accel: npt.NDArray[np.float64]
    ) -> None:
        """One Imu measurement: gyro (3,) rad/s, accel (3,) m/s^2; it has no orientation."""
        vector, quaternion = (self._types[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Quaternion"))
        # REP 145: -1 in the first element says that there is no estimate.
        no_orientation = np.array([-1.0, *[0.0] * 8])
        message = self._types[IMU](
            header=self._header(t_ns, topic),
            orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=no_orientation,
            angular_velocity=vector(*map(float, gyro)),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(*map(float, accel)),
            linear_acceleration_covariance=np.zeros(9),
        )
        self._write(topic, IMU, t_ns, message)

    def _write(self, topic: str, kind: str, host_ns: int, message: Any) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=typestore())
        self._writer.write(self._connections[topic], host_ns, typestore().serialize_cdr(message, kind))

    def _time(self, t_ns: int) -> Any:
        return self._types["builtin_interfaces/msg/Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)

    def _header(self, t_ns: int, topic: str) -> Any:
        return self._types["std_msgs/msg/Header"](stamp=self._time(t_ns), frame_id=topic.strip("/"))


@contextmanager
def write_bag(folder: Path, storage: Literal["sqlite3", "mcap"] = "sqlite3") -> Iterator[BagWriter]:
    """Create the bag `folder`, which must not exist, and yield a writer of its messages."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        yield BagWriter(writer)
