"""What the assignment of splits knows of a sequence: its frames, their strata and where they were taken."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_table
from card.errors import CardError
from card.splits.strata import frame_topographies, sequence_topography, stratum
from card.splits.tracks import Track, read_track


@dataclass(frozen=True)
class Drive:
    """A sequence; the arrays have one entry a frame.

    Attributes
    ----------
    frames, t_ns : numbers and times of all frames. sampled : which of them are.
    strata : topography/place of each frame. track : where the frames were taken, None without poses.
    """

    id: str
    place: str
    role: str
    frames: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    sampled: NDArray[np.bool_]
    strata: tuple[str, ...]
    track: Track | None = None


@dataclass(frozen=True)
class Unit:
    """Frames `first..last` of a drive, both included, that get one split; `last` None is to the end."""

    drive: Drive
    first: int
    last: int | None

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Which frames of the drive belong to it."""
        frames = self.drive.frames
        return (frames >= self.first) & (frames <= (np.inf if self.last is None else self.last))

    @cached_property
    def counts(self) -> Counter[str]:
        """Sampled frames by stratum."""
        chosen = self.inside & self.drive.sampled
        return Counter(name for name, used in zip(self.drive.strata, chosen, strict=True) if used)

    @cached_property
    def places_m(self) -> NDArray[np.float64]:
        """Where its frames were taken, (N, 2) metres in the map of the drive's track."""
        if self.drive.track is None:
            return np.zeros((0, 2))
        known = np.isin(self.drive.track.frames, self.drive.frames[self.inside])
        return self.drive.track.places_m[known]

    @property
    def map(self) -> str:
        """The map of its places."""
        return self.drive.id if self.drive.track is None else self.drive.track.map

    @property
    def name(self) -> str:
        """The drive, with its first frame if the unit is a part of it."""
        return self.drive.id if (self.first, self.last) == (0, None) else f"{self.drive.id}:{self.first}"

    @property
    def stratum(self) -> str:
        """Stratum of the unit as a whole: that of its rarest topography."""
        topographies = {
            name.partition("/")[0] for name, used in zip(self.drive.strata, self.inside, strict=True) if used
        }
        return stratum(sequence_topography(topographies), self.drive.place)


def read_drives(
    sequences: Iterable[Mapping[str, Any]],
    results: Path,
    anchors: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
) -> list[Drive]:
    """Drives of the sheet's rows; a sequence in quarantine or without left images is none.

    `results` holds each sequence's `frames`, `labels` and `label_states` tables and, where it has poses,
    `poses.json`; `anchors` is as from `read_anchors`. CardError when a sequence has not been processed that
    far, because its length and topography decide.
    """
    return [
        _drive(sequence, results / sequence["id"], anchors, settings)
        for sequence in sequences
        if "camera_left" in sequence["modalities"] and not sequence["quarantine"]
    ]


def _drive(
    sequence: Mapping[str, Any],
    folder: Path,
    anchors: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
) -> Drive:
    paths = {name: folder / f"{name}.parquet" for name in ("frames", "labels", "label_states")}
    for path in paths.values():
        if not path.exists():
            raise CardError(
                "the sequence is not processed yet",
                where=f"sequence {sequence['id']}",
                found=f"no {path}",
                wanted="`snakemake release` first, then assign its split",
            )
    table = read_table(paths["frames"], "frames")
    frames = np.asarray(table["frame"], dtype=np.int64)
    topographies = frame_topographies(
        read_table(paths["labels"], "labels").to_pydict(),
        read_table(paths["label_states"], "label_states").to_pydict(),
        sequence["off_road"],
    )
    poses = folder / "poses.json"
    return Drive(
        id=sequence["id"],
        place=sequence["place"],
        role=sequence["role"],
        frames=frames,
        t_ns=np.asarray(table["t_ns"], dtype=np.int64),
        sampled=frames % settings["frame_step"] == settings["frame_offset"],
        strata=tuple(
            stratum(topographies.get(frame, "unknown"), sequence["place"]) for frame in frames.tolist()
        ),
        track=read_track(poses, sequence["id"], anchors) if poses.is_file() else None,
    )
