"""A bag becomes a recording in the raw layout."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import Figure, atomic_folder, progress, write_report, write_table
from card.errors import CardError
from card.recording.bag.bursts import PacketCount, cloud_bursts, packet_bursts
from card.recording.bag.clocks import check_synchronised, relate_clock
from card.recording.bag.images import jpeg_of
from card.recording.bag.messages import PACKETS, nanoseconds
from card.recording.bag.source import Source, open_bag
from card.recording.clock import SensorClock
from card.recording.description import read_description, write_description
from card.recording.hesai.angles import nominal_angles, read_channel_angles
from card.recording.hesai.packet import COLUMN_PERIOD_NS
from card.recording.laz import write_burst
from card.recording.paths import CAMERAS, LIDARS, burst_path, description_path, image_path, imu_path


def import_bag(*, recording: Path, out: Path, report: Path, settings: Mapping[str, Any]) -> None:
    """Write the drive that `recording` holds as a bag to `out`, in the raw layout.

    recording: folder with a recording.yaml that has a ``bag`` section; see schema ``recording``.
    out: folder, built whole: recording.yaml without that section and the sensors' data. What lies
    beside the bag (annotations, trajectory, privacy labels) is read where it is.
    settings: as schema ``settings/ingest``.

    A free-running sensor is put on the host's clock (see `fit_clock`); for one that is synchronised
    its own stamps are kept, and checked. Clock and packet losses are in the report.

    Raises CardError for a recording without a bag section and whatever the bag's topics do wrong.
    """
    description = read_description(recording)
    bag = description.get("bag")
    if bag is None:
        raise CardError("recording has no bag section", where=description_path(recording))
    unlisted = set(description["sensors"]) ^ set(bag["topics"])
    if unlisted:
        raise CardError(
            "sensors and topics disagree",
            where=description_path(recording),
            found=f"{sorted(unlisted)} only in one of them",
            wanted="a topic for each sensor",
        )
    counts: dict[str, int] = {}
    figures: list[Figure] = []
    notes: list[str] = []
    folder = recording / bag["folder"]
    with open_bag(folder, bag["topics"]) as sources, atomic_folder(out) as target:
        for source in sources:
            sensor = description["sensors"][source.sensor]
            clock = relate_clock(source)
            figures += _clock_figures(source.sensor, clock)
            applied = clock if sensor["clock"] == "free_running" else None
            if applied:
                notes.append(
                    f"{source.sensor} is free-running: its stamps are put on the host's clock by the highest "
                    "line that no stamp of the host lies below"
                )
            else:
                check_synchronised(source, clock, settings["clock_tolerance_ns"])
            if source.sensor in CAMERAS:
                counts[f"{source.sensor}_images"] = _write_images(source, applied, target, settings)
            elif source.sensor in LIDARS:
                counts |= _write_bursts(source, applied, target, recording, description)
            else:
                counts["imu_measurements"] = _write_imu(source, applied, target)
        write_description(target, {key: value for key, value in description.items() if key != "bag"})
    write_report(
        report,
        stage="import_bag",
        sequence=description["id"],
        settings=settings,
        inputs={"recording": description_path(recording), "bag_metadata": folder / "metadata.yaml"},
        counts=counts,
        figures=figures,
        notes=notes,
    )


def _clock_figures(sensor: str, clock: SensorClock) -> list[Figure]:
    return [
        Figure(
            f"{sensor}_clock_offset",
            clock.offset_ns / 1e9,
            "s",
            "host's stamp less the sensor's own for the message that was least delayed",
        ),
        Figure(
            f"{sensor}_clock_skew", clock.skew * 1e6, "ppm", "rate of the host's clock against the sensor's"
        ),
        Figure(f"{sensor}_clock_delay", clock.delay_ns / 1e6, "ms", "median delay beyond the least one"),
    ]


def _write_images(
    source: Source, clock: SensorClock | None, target: Path, settings: Mapping[str, Any]
) -> int:
    (target / source.sensor).mkdir()
    stream = progress(source.messages(), f"import {source.sensor}", source.count)
    for index, (message, _) in enumerate(stream):
        where = f"{source.where}, message {index}"
        t_ns = _on_host(nanoseconds(message.header.stamp), clock)
        path = _new(image_path(target, source.sensor, t_ns), where)
        path.write_bytes(jpeg_of(message, source.kind, settings["jpeg_quality"], where))
    return source.count


def _write_bursts(
    source: Source, clock: SensorClock | None, target: Path, recording: Path, description: Mapping[str, Any]
) -> dict[str, int]:
    lidar = source.sensor
    (target / lidar).mkdir()
    packets = PacketCount()
    if source.kind == PACKETS:
        given = description["bag"].get("channel_angles", {}).get(lidar)
        angles = read_channel_angles(recording / given) if given else nominal_angles()
        period_ns = description["sensors"][lidar].get("column_period_ns", COLUMN_PERIOD_NS)
        bursts = packet_bursts(source, angles, period_ns, clock, packets)
    else:
        bursts = cloud_bursts(source, clock)
    written = 0
    for burst in progress(bursts, f"import {lidar}", source.count):
        write_burst(_new(burst_path(target, lidar, burst.t_ns), source.where), burst)
        written += 1
    counts = {f"{lidar}_bursts": written}
    if source.kind == PACKETS:
        counts |= {f"{lidar}_packets": packets.packets, f"{lidar}_packets_lost": packets.lost}
    return counts


def _write_imu(source: Source, clock: SensorClock | None, target: Path) -> int:
    rows = []
    for message, _ in progress(source.messages(), "import imu", source.count):
        rate, force = message.angular_velocity, message.linear_acceleration
        t_ns = _on_host(nanoseconds(message.header.stamp), clock)
        rows.append((t_ns, rate.x, rate.y, rate.z, force.x, force.y, force.z))
    # A bag is in order of arrival, which may differ from that of measurement.
    rows.sort()
    names = ("t_ns", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    columns = dict(zip(names, zip(*rows, strict=True), strict=True))
    write_table(imu_path(target), {name: list(column) for name, column in columns.items()}, "imu")
    return len(rows)


def _on_host(t_ns: int, clock: SensorClock | None) -> int:
    return int(clock.to_host(np.array([t_ns]))[0]) if clock else t_ns


def _new(path: Path, where: object) -> Path:
    if path.exists():
        raise CardError("two messages of the same time", where=where, found=path.stem)
    return path
