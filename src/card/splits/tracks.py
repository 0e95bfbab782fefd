"""Where the frames of a sequence were taken, in a map that sequences may share."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json, read_sheet
from card.errors import CardError


@dataclass(frozen=True)
class Track:
    """Horizontal places (N, 2) in metres of `frames` (N,) in the map called `map`."""

    map: str
    frames: NDArray[np.int64]
    places_m: NDArray[np.float64]


def read_anchors(path: Path) -> dict[str, dict[str, Any]]:
    """Anchors of `config/anchors.tsv` by sequence: where its `world` lies in a map that others share.

    The world frame of each sequence begins where its drive does. Two sequences can be compared only once
    somebody says, from satellite fixes or a joint map, how their worlds lie to each other.
    """
    anchors: dict[str, dict[str, Any]] = {}
    for row in read_sheet(path, "anchors"):
        if row["sequence"] in anchors:
            raise CardError("sequence anchored twice", where=path, found=row["sequence"])
        numbers = {name: float(row[name]) for name in ("east_m", "north_m", "heading_rad")}
        anchors[row["sequence"]] = {"map": row["map"], **numbers}
    return anchors


def read_track(poses: Path, sequence: str, anchors: Mapping[str, Mapping[str, Any]]) -> Track:
    """Track of the left images in a document `poses`; without an anchor its map is the sequence's own."""
    rows = [row for row in read_json(poses, "poses")["poses"] if row["sensor"] == "camera_left"]
    frames = np.array([row["index"] for row in rows], dtype=np.int64)
    places = np.array([row["translation_m"][:2] for row in rows], dtype=np.float64).reshape(-1, 2)
    anchor = anchors.get(sequence)
    if anchor is None:
        return Track(sequence, frames, places)
    cosine, sine = np.cos(anchor["heading_rad"]), np.sin(anchor["heading_rad"])
    turned = places @ np.array([[cosine, sine], [-sine, cosine]])
    # Maps are named apart from sequences, which are maps of their own.
    return Track(f"map {anchor['map']}", frames, turned + np.array([anchor["east_m"], anchor["north_m"]]))
