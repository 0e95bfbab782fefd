"""Scans are cut where the rotor passes azimuth 0, wherever messages or packets happen to end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from card.recording.burst import Burst
from card.recording.hesai.angles import ChannelAngles
from card.recording.hesai.decode import Columns, points_of
from card.recording.hesai.packet import AZIMUTH_UNITS, CHANNEL_OFFSET_NS

# Half a turn at 10 Hz: after a longer silence nobody knows how often the rotor passed 0.
_SILENCE_NS = 50_000_000


def whole_scans(chunks: Iterable[Columns]) -> Iterator[Columns]:
    """Columns in order of time, in pieces of any size -> one `Columns` a whole turn.

    Turns that are cut off, at the ends or by a silence of half a turn, are left out.
    """
    rest: list[Columns] = []
    begun = False  # the turn in `rest` begins at azimuth 0
    for chunk in chunks:
        if not len(chunk):
            continue
        if not rest:
            begun = _touches_zero(chunk, at_start=True)
        before = rest[-1] if rest else chunk[:1]
        azimuth = np.concatenate([before.azimuth[-1:], chunk.azimuth])
        silent = np.diff(np.concatenate([before.time_ns[-1:], chunk.time_ns])) > _SILENCE_NS
        passed = np.diff(azimuth) < -AZIMUTH_UNITS // 2
        start = 0
        for cut in np.flatnonzero(passed | silent).tolist():
            rest.append(chunk[start:cut])
            if begun and not silent[cut]:
                yield _join(rest)
            rest, start, begun = [], cut, not silent[cut]
        rest.append(chunk[start:])
    if rest and begun:
        last = _join(rest)
        if _touches_zero(last, at_start=False):
            yield last


def burst_of(scan: Columns, angles: ChannelAngles) -> Burst:
    """One scan -> one burst that starts with the first shot of its first column."""
    points = points_of(scan, angles)
    t_ns = int(scan.time_ns[0] + CHANNEL_OFFSET_NS[0])
    # Time stamps in whole microseconds let a column slip before its neighbour, never before the first.
    offset = np.maximum(points.time_ns - t_ns, 0)
    return Burst(t_ns, points.points, points.intensity, points.ring, offset.astype(np.uint32))


def _join(parts: list[Columns]) -> Columns:
    return Columns(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Columns.__dataclass_fields__)
    )


def _touches_zero(columns: Columns, *, at_start: bool) -> bool:
    """Whether the rotor passes 0 within a column of the first or last one of `columns`."""
    if len(columns) < 2:
        return False
    step = int(np.median(np.diff(columns.azimuth) % AZIMUTH_UNITS))
    gap = columns.azimuth[0] if at_start else AZIMUTH_UNITS - columns.azimuth[-1]
    return bool(gap < step if at_start else gap <= step)
