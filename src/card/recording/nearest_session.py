"""Which calibration session of its day a recording is nearest to.

Used while the workflow is parsed: no sensor data is read but the names of files.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from card.errors import CardError
from card.recording.paths import CAMERAS, LIDARS, stamp_of

BAG_METADATA = "metadata.yaml"


def nearest_session(start_ns: int, sessions: Mapping[str, int], where: object) -> str:
    """The session whose start is nearest to that of a recording; of two equally near ones the earlier.

    sessions : start of each session by its name, ns.

    Raises
    ------
    CardError
        If there are none.
    """
    if not sessions:
        raise CardError("no calibration session of that day", where=where)
    return min(sorted(sessions), key=lambda name: abs(sessions[name] - start_ns))


def start_of(folder: Path) -> int:
    """When a recording or a session in the raw layout, or a bag, starts: ns on the clock of its stamps.

    Raises
    ------
    CardError
        If no file says so.
    """
    stamps = [
        stamp_of(path)
        for sensor in (*CAMERAS, *LIDARS)
        for path in (folder / sensor).glob("[0-9]*")
        if path.suffix in (".jpg", ".laz")
    ]
    if stamps:
        return min(stamps)
    if (folder / BAG_METADATA).is_file():
        return _bag_start(folder / BAG_METADATA)
    raise CardError(
        "no file says when it starts",
        where=folder,
        wanted=f"images, sweeps or a bag's {BAG_METADATA}; or name the session in the sheet",
    )


def _bag_start(path: Path) -> int:
    import yaml

    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
        return int(found["rosbag2_bagfile_information"]["starting_time"]["nanoseconds_since_epoch"])
    except (yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise CardError("no starting_time of a rosbag2", where=path, found=error) from error
