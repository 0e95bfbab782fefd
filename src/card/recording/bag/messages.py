"""The ROS 2 messages a recording is made of."""

from __future__ import annotations

from functools import cache
from typing import Any

PACKETS = "pandar_msgs/msg/PandarScan"
CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
IMU = "sensor_msgs/msg/Imu"

PACKET_CAPACITY = 1500
_PANDAR_PACKET = f"""
builtin_interfaces/Time stamp
uint8[{PACKET_CAPACITY}] data
uint32 size
"""
_PANDAR_SCAN = """
std_msgs/Header header
pandar_msgs/PandarPacket[] packets
"""


@cache
def typestore() -> Any:
    """The message types of ROS 2 Humble and those of pandar_msgs, as `rosbags` wants them."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(_PANDAR_PACKET, "pandar_msgs/msg/PandarPacket"))
    store.register(get_types_from_msg(_PANDAR_SCAN, PACKETS))
    return store


def nanoseconds(stamp: Any) -> int:
    """builtin_interfaces/Time -> nanoseconds."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
