"""Where each channel of a LiDAR points."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.recording.hesai.packet import CHANNELS


@dataclass(frozen=True)
class ChannelAngles:
    """Elevation above the horizon and azimuth added to the rotor's, (32,) float64 radians each.

    Azimuth 0 is +y of the sensor frame and grows clockwise seen from above.
    """

    elevation_rad: npt.NDArray[np.float64]
    azimuth_rad: npt.NDArray[np.float64]


def nominal_angles() -> ChannelAngles:
    """The manual's channel distribution: +15 to -16 degrees in steps of one, no azimuth offset."""
    return ChannelAngles(np.radians(15.0 - np.arange(CHANNELS)), np.zeros(CHANNELS))


def read_channel_angles(path: Path) -> ChannelAngles:
    """The angle file that comes with a unit: CSV with Channel (1..32), Elevation, Azimuth in degrees.

    Raises CardError for a missing file, missing columns, a channel absent, twice or without a number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError) as error:
        raise CardError("unreadable channel angles", where=path, found=error) from error
    table: dict[int, tuple[float, float]] = {}
    for line, row in enumerate(rows, start=2):
        # Some firmware heads the first column "Laser id".
        name = row.get("Channel") or row.get("Laser id")
        try:
            channel = int(name or "")
            angles = float(row["Elevation"]), float(row["Azimuth"])
        except (KeyError, TypeError, ValueError):
            raise CardError(
                "bad row of channel angles",
                where=f"{path}, line {line}",
                found=list(row.values()),
                wanted="Channel,Elevation,Azimuth in degrees",
            ) from None
        if channel in table or not np.isfinite(angles).all():
            raise CardError("channel given twice or not finite", where=f"{path}, line {line}", found=channel)
        table[channel] = angles
    if sorted(table) != list(range(1, CHANNELS + 1)):
        raise CardError(
            "channels missing from the angles", where=path, found=sorted(table), wanted=f"1 to {CHANNELS}"
        )
    degrees = np.array([table[channel] for channel in sorted(table)])
    return ChannelAngles(np.radians(degrees[:, 0]), np.radians(degrees[:, 1]))


def write_channel_angles(path: Path, angles: ChannelAngles) -> None:
    """Write `angles` the way `read_channel_angles` reads them, to a millionth of a degree."""
    degrees = np.degrees(np.column_stack([angles.elevation_rad, angles.azimuth_rad]))
    lines = [f"{channel},{el:.6f},{az:.6f}" for channel, (el, az) in enumerate(degrees, start=1)]
    path.write_text("\n".join(["Channel,Elevation,Azimuth", *lines]) + "\n", encoding="utf-8")
