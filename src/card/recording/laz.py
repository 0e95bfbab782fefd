"""Bursts on disk: LAS 1.4, compressed, at 0.1 mm."""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import Any

import laspy
import lazrs
import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.recording.burst import MAX_BURST_NS, Burst
from card.recording.hesai.packet import CHANNELS
from card.recording.laz_kernels import unpack
from card.recording.paths import stamp_of

#: Metres a unit; the sensor's own unit is 4 mm, its noise some mm.
SCALE_M = 1e-4
_EXTRA = {"ring": np.dtype(np.uint8), "offset_ns": np.dtype(np.uint32)}
# The header wants a date; a constant one keeps the bytes a function of the burst alone.
_CREATION_DATE = date(2000, 1, 1)
#: Bytes of a header that tell of the points and not of their form: counts and bounds (LAS 1.4, table 3), also
#: 64 to 112 of each descriptor of extra bytes (table 24).
_HEADER_BYTES, _RECORD_BYTES, _EXTRA_BYTES = 227, 54, (b"LASF_Spec", 4)
_SUMMARY, _SUMMARY_1_4 = [(107, 131), (179, 227)], (247, 375)
#: Layers of a point that a burst has: x and y come always.
_LAYERS = lazrs.SELECTIVE_DECOMPRESS_Z | lazrs.SELECTIVE_DECOMPRESS_ALL_EXTRA_BYTES
_INTENSITY = lazrs.SELECTIVE_DECOMPRESS_INTENSITY
_UNREADABLE = (
    laspy.errors.LaspyException,
    RuntimeError,
    ValueError,
    OSError,
    struct.error,
    EOFError,
    IndexError,
    MemoryError,
)


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


def read_burst(path: Path, *, intensity: bool = True) -> Burst:
    """Read the burst at <t_ns>.laz; its start comes from the name.

    intensity : whether it is wanted; without it, reading takes a tenth less and it is 0.

    Raises CardError, naming the file, for a file that is missing or no LAZ, lacks a dimension,
    or has points that are not finite, unknown rings or times that are not within one burst.
    """
    t_ns = stamp_of(path)
    try:
        raw = path.read_bytes()
        layout, count = _opened(raw)
        records = layout.records(raw, count, intensity)
    except FileNotFoundError:
        raise CardError("no such burst", where=path) from None
    except _UNREADABLE as error:
        raise CardError(
            "unreadable LAZ", where=path, found=_first_line(error), wanted="LAS 1.4, LAZ"
        ) from error
    for name, dtype in _EXTRA.items():
        have = layout.dimensions.get(name)
        if have != dtype:
            raise CardError(
                "LAZ lacks a dimension",
                where=path,
                found=have or "none",
                wanted=f"extra dimension {name}, {dtype}",
            )
    grey = records["intensity"] if intensity else np.zeros(count, dtype=np.uint8)
    if count and grey.max() > 255:
        raise CardError("intensity is not 8 bit", where=path, found=int(grey.max()), wanted="0 to 255")
    fields = (records[name] for name in ("X", "Y", "Z", *_EXTRA))
    points, ring, offset_ns, (finite, last, late) = unpack(*fields, layout.scales, layout.offsets)
    burst = Burst(t_ns, points, grey.astype(np.uint8), ring, offset_ns)
    if not finite or last >= CHANNELS or late > MAX_BURST_NS:
        _check(burst, path)
    return burst


@dataclass(frozen=True)
class _Layout:
    """What the headers of the files of one writer have in common.

    start : byte at which the points start. record, dimensions : of a point, as stored and as laspy has it.
    laszip : how they are compressed. scales, offsets : (3,) of the coordinates, metres.
    """

    start: int
    record: np.dtype[np.void]
    dimensions: dict[str, np.dtype[Any] | None]
    laszip: bytes
    scales: npt.NDArray[np.float64]
    offsets: npt.NDArray[np.float64]

    def records(self, raw: bytes, count: int, intensity: bool) -> npt.NDArray[np.void]:
        """The points (count,) as they are stored, in what a burst has of them."""
        found = np.empty(count, dtype=self.record)
        if count:
            source = io.BytesIO(raw)
            source.seek(self.start)
            wanted = lazrs.DecompressionSelection(_LAYERS | (_INTENSITY if intensity else 0))
            lazrs.LasZipDecompressor(source, self.laszip, wanted).decompress_many(found.view(np.uint8))
        return found


def _opened(raw: bytes) -> tuple[_Layout, int]:
    """The layout of a file and how many points it has."""
    if len(raw) < _HEADER_BYTES:
        raise ValueError("header is cut off")
    at, start, records = struct.unpack_from("<HII", raw, 94)
    head = bytearray(raw[:start])
    told = [*_SUMMARY, _SUMMARY_1_4] if raw[25] >= 4 else list(_SUMMARY)
    for _ in range(records):
        user, number, length = struct.unpack_from("<16sHH", raw, at + 2)
        at += _RECORD_BYTES
        if (user.rstrip(b"\0"), number) == _EXTRA_BYTES:
            told += [(at + d + 64, at + d + 112) for d in range(0, length, 192)]
        at += length
    for first, last in told:
        head[first:last] = bytes(last - first)
    (count,) = struct.unpack_from("<Q", raw, 247) if raw[25] >= 4 else struct.unpack_from("<I", raw, 107)
    return _layout(bytes(head)), count


@lru_cache(maxsize=16)
def _layout(head: bytes) -> _Layout:
    """The layout of files with this header; laspy takes longer over it than over a tenth of a sweep."""
    header = laspy.LasHeader.read_from(io.BytesIO(head))
    if not header.are_points_compressed:
        raise ValueError("points are not compressed")
    dimensions = {dimension.name: dimension.dtype for dimension in header.point_format.dimensions}
    laszip = header.vlrs.get("LasZipVlr")[0].record_data
    record = header.point_format.dtype()
    return _Layout(len(head), record, dimensions, laszip, header.scales.copy(), header.offsets.copy())


def _check(burst: Burst, path: Path) -> None:
    count = len(burst.points)
    if burst.points.shape != (count, 3) or any(
        len(column) != count for column in (burst.intensity, burst.ring, burst.offset_ns)
    ):
        raise CardError("burst columns differ in length", where=path, wanted="N points with N of each column")
    finite = np.isfinite(burst.points)
    if not finite.all():
        bad = np.flatnonzero(~finite.all(axis=1))
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
