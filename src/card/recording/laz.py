"""Bursts on disk: LAS 1.4, compressed, at 0.1 mm."""

from __future__ import annotations

import struct
from datetime import date
from pathlib import Path

import laspy
import numpy as np

from card.errors import CardError
from card.recording.burst import MAX_BURST_NS, Burst
from card.recording.hesai.packet import CHANNELS
from card.recording.paths import stamp_of

#: Metres a unit; the sensor's own unit is 4 mm, its noise some mm.
SCALE_M = 1e-4
_EXTRA = {"ring": np.dtype(np.uint8), "offset_ns": np.dtype(np.uint32)}
# The header wants a date; a constant one keeps the bytes a function of the burst alone.
_CREATION_DATE = date(2000, 1, 1)


def write_burst(path: Path, burst: Burst) -> None:
    """Write `burst` to `path`, which must be named <t_ns>.laz after the burst's start.

    The same burst gives the same bytes. Coordinates are rounded to 0.1 mm.
    Raises CardError when the burst breaks the rules that `read_burst` checks.
    """
    _check(burst, path)
    if stamp_of(path) != burst.t_ns:
        raise CardError("burst written under another time", where=path, found=path.stem, wanted=burst.t_ns)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = _CREATION_DATE
    header.generating_software = "card"
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.zeros(3)
    header.add_extra_dims([laspy.ExtraBytesParams(name, dtype) for name, dtype in _EXTRA.items()])
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(len(burst), header=header)
    las.xyz = burst.points
    las.intensity = burst.intensity
    las.ring = burst.ring
    las.offset_ns = burst.offset_ns
    las.write(path, laz_backend=laspy.LazBackend.Lazrs)


def read_burst(path: Path) -> Burst:
    """Read the burst at <t_ns>.laz; its start comes from the name.

    Raises CardError, naming the file, for a file that is missing or no LAZ, lacks a dimension,
    or has points that are not finite, unknown rings or times that are not within one burst.
    """
    t_ns = stamp_of(path)
    try:
        las = laspy.read(path, laz_backend=laspy.LazBackend.Lazrs)
    except FileNotFoundError:
        raise CardError("no such burst", where=path) from None
    except (laspy.errors.LaspyException, RuntimeError, ValueError, OSError, struct.error, EOFError) as error:
        raise CardError(
            "unreadable LAZ", where=path, found=_first_line(error), wanted="LAS 1.4, LAZ"
        ) from error
    for name, dtype in _EXTRA.items():
        have = {d.name: d.dtype for d in las.point_format.dimensions}.get(name)
        if have != dtype:
            raise CardError(
                "LAZ lacks a dimension",
                where=path,
                found=have or "none",
                wanted=f"extra dimension {name}, {dtype}",
            )
    if len(las.intensity) and las.intensity.max() > 255:
        raise CardError(
            "intensity is not 8 bit", where=path, found=int(las.intensity.max()), wanted="0 to 255"
        )
    burst = Burst(
        t_ns=t_ns,
        points=np.ascontiguousarray(las.xyz, dtype=np.float64),
        intensity=np.array(las.intensity, dtype=np.uint8),
        ring=np.array(las.ring, dtype=np.uint8),
        offset_ns=np.array(las.offset_ns, dtype=np.uint32),
    )
    _check(burst, path)
    return burst


def _check(burst: Burst, path: Path) -> None:
    count = len(burst.points)
    if burst.points.shape != (count, 3) or any(
        len(column) != count for column in (burst.intensity, burst.ring, burst.offset_ns)
    ):
        raise CardError("burst columns differ in length", where=path, wanted="N points with N of each column")
    bad = np.flatnonzero(~np.isfinite(burst.points).all(axis=1))
    if len(bad):
        raise CardError(
            "points that are not finite", where=path, found=f"{len(bad)} of {count}, first is point {bad[0]}"
        )
    if count and burst.ring.max() >= CHANNELS:
        raise CardError(
            "ring that the sensor does not have",
            where=path,
            found=int(burst.ring.max()),
            wanted=f"0 to {CHANNELS - 1}, 0 at the top",
        )
    late = np.flatnonzero(burst.offset_ns > MAX_BURST_NS)
    if len(late):
        raise CardError(
            "point times outside the burst",
            where=path,
            found=f"{len(late)} points, up to {int(burst.offset_ns.max())} ns after the start",
            wanted=f"at most {MAX_BURST_NS} ns",
        )


def _first_line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
