"""The ledger of frame numbers: a number is given once and for all."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from card.artifacts import atomic_file, read_sheet
from card.errors import CardError


def number_frames(ledger: Path, left_t_ns: Iterable[int]) -> dict[int, int]:
    """Numbers of the left images at `left_t_ns`: {t_ns: frame}.

    An image that the ledger knows keeps its number; others get the next ones in order of time, and
    are added to the ledger. The number of an image that is gone stays taken.
    Raises CardError for a ledger that does not count up from 0 or has a time twice.
    """
    known = _read(ledger) if ledger.is_file() else []
    numbers = {t_ns: frame for frame, t_ns in enumerate(known)}
    new = sorted(set(left_t_ns) - set(numbers))
    for t_ns in new:
        numbers[t_ns] = len(numbers)
    if new or not ledger.is_file():
        with atomic_file(ledger) as partial:
            rows = [f"{frame}\t{t_ns}\n" for t_ns, frame in numbers.items()]
            partial.write_text("".join(["frame\tt_ns\n", *rows]), encoding="utf-8")
    return {t_ns: numbers[t_ns] for t_ns in left_t_ns}


def _read(ledger: Path) -> list[int]:
    times: list[int] = []
    for row in read_sheet(ledger, "frame_ledger"):
        if int(row["frame"]) != len(times):
            raise CardError(
                "ledger of frame numbers was edited", where=ledger, found=row, wanted=f"frame {len(times)}"
            )
        times.append(int(row["t_ns"]))
    if len(set(times)) != len(times):
        raise CardError("ledger of frame numbers has a time twice", where=ledger, wanted="each t_ns once")
    return times
