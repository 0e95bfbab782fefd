"""A native recording as a car that records with ROS 2 would have left it: one bag, LiDARs as packets."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_table
from card.recording.bag.write import BagWriter, write_bag
from card.recording.burst import Burst
from card.recording.description import read_description, write_description
from card.recording.hesai.angles import nominal_angles, write_channel_angles
from card.recording.hesai.decode import Columns
from card.recording.hesai.encode import encode_packets, quantise_columns
from card.recording.hesai.packet import (
    AZIMUTH_UNITS,
    BLOCKS,
    CHANNEL_OFFSET_NS,
    CHANNELS,
    packet_time_ns,
)
from card.recording.laz import read_burst
from card.recording.paths import CAMERAS, IMU, LIDARS, imu_path, list_bursts, list_images, stamp_of

TOPICS = {
    "camera_left": "/camera_left/image/compressed",
    "camera_right": "/camera_right/image/compressed",
    "lidar_front": "/lidar_front/pandar_packets",
    "lidar_rear": "/lidar_rear/pandar_packets",
    "imu": "/imu/data",
}
TURN_NS = 100_000_000
_FOLDER = "bag"
_PACKETS_A_MESSAGE = 36  # not a turn: a driver's messages end anywhere
_TRANSPORT_NS, _QUEUE_NS = 120_000, 60_000  # least delay of a packet, mean of what comes on top


def as_bag(native: Path, recording: Path) -> None:
    """Write into the folder `recording` what `native`, a recording in the raw layout, holds, as a bag.

    Sensors' data go to bag/ (sqlite3), the angle files of the LiDARs and recording.yaml beside it;
    whatever else `native` has (annotations, trajectory, labels) is copied. The packets hold azimuths in
    0.01 degrees and ranges in 4 mm, so bursts whose values have those steps come back as they were.
    """
    description = read_description(native)
    sensors = {name: dict(sensor) for name, sensor in description["sensors"].items()}
    angles = {}
    with write_bag(recording / _FOLDER) as bag:
        for lidar in LIDARS:
            if lidar in sensors:
                sensors[lidar]["column_period_ns"] = _write_packets(bag, native, lidar)
                angles[lidar] = f"{lidar}_angles.csv"
        for camera in CAMERAS:
            for image in list_images(native, camera):
                bag.image(TOPICS[camera], stamp_of(image), image.read_bytes())
        if IMU in sensors:
            _write_imu(bag, native)
    for name in angles.values():
        write_channel_angles(recording / name, nominal_angles())
    topics = {name: TOPICS[name] for name in sorted(sensors)}
    section = {"folder": _FOLDER, "topics": topics, "channel_angles": angles}
    write_description(recording, {**description, "sensors": sensors, "bag": section})
    for path in sorted(native.iterdir()):
        if path.name in (*TOPICS, imu_path(native).name, "recording.yaml"):
            continue
        if path.is_dir():
            shutil.copytree(path, recording / path.name)
        else:
            shutil.copyfile(path, recording / path.name)


def columns_of_burst(burst: Burst) -> tuple[Columns, int]:
    """The rounds of firing of a burst of a steadily turning LiDAR, and the time between them in ns.

    Rounds without a return are filled in. To end with a full packet, empty rounds follow with the rotor
    held before zero, where they cannot be taken for the next turn.
    """
    ring = burst.ring.astype(np.int64)
    fired = burst.offset_ns.astype(np.int64) - (CHANNEL_OFFSET_NS[ring] - CHANNEL_OFFSET_NS[0])
    starts = np.unique(fired)
    period = int(np.diff(starts).min())
    step = round(period * AZIMUTH_UNITS / TURN_NS)
    column = np.rint((fired - starts[0]) / period).astype(np.int64)
    first = _first_azimuth(burst, step * column)
    before = first // step  # rounds before the first return
    count = (AZIMUTH_UNITS - 1 - first % step) // step + 1
    count += -count % BLOCKS
    ranges = np.full((count, CHANNELS), np.nan)
    reflectivity = np.zeros((count, CHANNELS), np.uint8)
    ranges[before + column, ring] = np.linalg.norm(burst.points, axis=1)
    reflectivity[before + column, ring] = burst.intensity
    index = np.arange(count) - before
    azimuth = np.minimum(first + step * index, AZIMUTH_UNITS - 1)
    time_ns = burst.t_ns + starts[0] + period * index - CHANNEL_OFFSET_NS[0]
    return quantise_columns(np.radians(azimuth / 100), time_ns, ranges, reflectivity), period


def _first_azimuth(burst: Burst, turned: NDArray[np.int64]) -> int:
    """Rotor azimuth of the first return's round, 0.01 degrees, given by how much each point's is farther."""
    x, y, _ = burst.points.T
    # Stored to 0.1 mm, a near point's azimuth is too coarse; the median of all is not.
    first = np.degrees(np.arctan2(x, y)) * 100 - turned
    near = first[0]
    half = AZIMUTH_UNITS // 2
    return int(np.rint(np.median((first - near + half) % AZIMUTH_UNITS - half + near))) % AZIMUTH_UNITS


def _write_packets(bag: BagWriter, native: Path, lidar: str) -> int:
    """Write one LiDAR's packets; the time between its rounds of firing."""
    rng = np.random.default_rng(LIDARS.index(lidar))
    packets: list[NDArray[np.void]] = []
    period, sent = 0, 0
    for path in list_bursts(native, lidar):
        columns, period = columns_of_burst(read_burst(path))
        packets.append(encode_packets(columns, column_period_ns=period, first_sequence=sent + 1))
        sent += len(packets[-1])
    stream = np.concatenate(packets)
    delay = _TRANSPORT_NS + rng.exponential(_QUEUE_NS, len(stream)).astype(np.int64)
    host_ns = np.maximum.accumulate(packet_time_ns(stream) + delay)
    for begin in range(0, len(stream), _PACKETS_A_MESSAGE):
        part = slice(begin, begin + _PACKETS_A_MESSAGE)
        bag.packets(TOPICS[lidar], stream[part], host_ns[part])
    return period


def _write_imu(bag: BagWriter, native: Path) -> None:
    table: dict[str, Any] = read_table(imu_path(native), "imu").to_pydict()
    gyro = np.column_stack([table[f"gyro_{axis}"] for axis in "xyz"])
    accel = np.column_stack([table[f"accel_{axis}"] for axis in "xyz"])
    for t_ns, rate, force in zip(table["t_ns"], gyro, accel, strict=True):
        bag.imu(TOPICS[IMU], t_ns, rate, force)
