"""sensor_msgs/PointCloud2 to points with ring and time."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.recording.bag.messages import nanoseconds
from card.recording.hesai.decode import Points

_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# Drivers disagree on names; the first one present is taken.
_TIME = ("timestamp", "time_stamp", "offset_time", "time", "t")
_RING = ("ring", "channel", "line")
_INTENSITY = ("reflectivity", "intensity")
# More than so many seconds since the message's stamp can only be time since 1970, more than so many still
# only nanoseconds.
_ABSOLUTE_FROM_S, _NANOSECONDS_FROM = 1e6, 1e15


def points_of_cloud(cloud: Any, where: object) -> Points:
    """A cloud -> its points on the message's clock, in order of time.

    Integer times are nanoseconds since the message's stamp; floating ones are seconds since the stamp,
    or since 1970 where they are that large, and nanoseconds where they are larger still. A cloud that
    says it is not dense may hold points that are not finite, which are no returns and left out; so are
    points at the origin.

    Raises CardError when position, per-point time, ring or intensity are missing or out of range.
    """
    table = _table(cloud, where)
    names = table.dtype.names or ()
    for axis in "xyz":
        if axis not in names:
            raise CardError("cloud lacks a field", where=where, found=list(names), wanted=axis)
    time_name = _field(names, _TIME, "time of each point: it cannot be deskewed without", where)
    ring = table[_field(names, _RING, "ring", where)]
    intensity = table[_field(names, _INTENSITY, "intensity", where)]
    points = np.column_stack([table[axis] for axis in "xyz"]).astype(np.float64)
    finite = np.isfinite(points).all(axis=1)
    if cloud.is_dense and not finite.all():
        raise CardError(
            "points that are not finite in a dense cloud", where=where, found=int((~finite).sum())
        )
    keep = finite & points.any(axis=1)
    times = table[time_name][keep]
    if not np.isfinite(times).all():
        raise CardError("points without a time", where=where, found=int((~np.isfinite(times)).sum()))
    time_ns = _time_ns(times, nanoseconds(cloud.header.stamp))
    order = np.argsort(time_ns, kind="stable")
    return Points(
        points=points[keep][order],
        intensity=_byte(intensity[keep][order], "intensity", where),
        ring=_byte(ring[keep][order], "ring", where),
        time_ns=time_ns[order],
    )


def _table(cloud: Any, where: object) -> npt.NDArray[np.void]:
    if cloud.is_bigendian != (sys.byteorder == "big"):
        raise CardError("cloud of another byte order", where=where, wanted=f"{sys.byteorder} endian")
    fields = [field for field in cloud.fields if field.count in (0, 1)]
    unknown = [field.datatype for field in fields if field.datatype not in _KINDS]
    if unknown:
        raise CardError("unknown field type in cloud", where=where, found=unknown[0], wanted="1 to 8")
    layout = np.dtype(
        {
            "names": [field.name for field in fields],
            "formats": [_KINDS[field.datatype] for field in fields],
            "offsets": [field.offset for field in fields],
            "itemsize": cloud.point_step,
        }
    )
    rows = np.asarray(cloud.data).reshape(cloud.height, cloud.row_step)
    packed = np.ascontiguousarray(rows[:, : cloud.width * cloud.point_step])
    return packed.reshape(-1).view(layout)


def _field(names: tuple[str, ...], spellings: tuple[str, ...], what: str, where: object) -> str:
    for spelling in spellings:
        if spelling in names:
            return spelling
    raise CardError(f"cloud lacks {what}", where=where, found=list(names), wanted=f"one of {list(spellings)}")


def _time_ns(values: npt.NDArray[Any], stamp_ns: int) -> npt.NDArray[np.int64]:
    if values.dtype.kind in "iu":
        return stamp_ns + values.astype(np.int64)
    seconds = values.astype(np.float64)
    if np.max(seconds, initial=0.0) < _ABSOLUTE_FROM_S:
        return stamp_ns + np.rint(seconds * 1e9).astype(np.int64)
    if np.min(seconds) >= _NANOSECONDS_FROM:
        return np.rint(seconds).astype(np.int64)
    # Whole seconds apart: their product with 1e9 does not fit a float64.
    whole = np.floor(seconds)
    return whole.astype(np.int64) * 1_000_000_000 + np.rint((seconds - whole) * 1e9).astype(np.int64)


def _byte(values: npt.NDArray[Any], what: str, where: object) -> npt.NDArray[np.uint8]:
    rounded = np.rint(values)
    if not ((rounded >= 0) & (rounded <= 255)).all():
        raise CardError(f"{what} out of range", where=where, found=float(np.max(values)), wanted="0 to 255")
    return rounded.astype(np.uint8)
