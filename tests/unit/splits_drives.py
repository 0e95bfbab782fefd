"""Drives for tests of the splits, without files."""

from typing import Any

import numpy as np

from card.artifacts import default_settings
from card.splits.drives import Drive
from card.splits.tracks import Track

SETTINGS = default_settings("splits")


def drive(
    name: str,
    stratum: str = "none/town",
    seconds: float = 30,
    role: str = "split",
    start: tuple[float, float] | None = None,
    strata: tuple[str, ...] = (),
    map_name: str = "map town",
) -> Drive:
    """A drive at 10 Hz; from `start` on it goes east at 10 m/s, without `start` nobody knows where it was."""
    count = round(10 * seconds) + 1
    frames = np.arange(count)
    places = (
        None if start is None else np.array(start) + np.stack([np.arange(count) * 1.0, np.zeros(count)], 1)
    )
    return Drive(
        id=name,
        place=stratum.partition("/")[2],
        role=role,
        frames=frames,
        t_ns=frames * 100_000_000,
        sampled=frames % 3 == 0,
        strata=strata or (stratum,) * count,
        track=None if places is None else Track(map_name, frames, places),
    )


def drives(count: int, stratum: str = "none/town", **arguments: Any) -> list[Drive]:
    return [drive(f"{stratum[:3]}{index:03d}", stratum, **arguments) for index in range(count)]
