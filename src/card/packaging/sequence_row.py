"""What a release says about one sequence as a whole."""

from collections.abc import Mapping
from typing import Any

from card.packaging.modalities import MODALITIES, Rows

Columns = Mapping[str, list[Any]]


def sequence_document(
    sequence: Mapping[str, Any],
    spdx: str,
    frames: Columns,
    members: Columns,
    bursts: Rows,
    distance_m: float | None,
) -> dict[str, Any]:
    """Document `release_sequence` from the packed frames and members.

    `bursts` give the span of time, which the cameras may cover only in part.
    """
    starts = [row["t_start_ns"] for row in bursts] + frames["t_ns"]
    ends = [row["t_end_ns"] for row in bursts] + frames["t_ns"]
    packed = set(members["modality"])
    return {
        "sequence": sequence["id"],
        "country": sequence["country"],
        "place": sequence["place"],
        "road_type": sequence["road_type"],
        "light": sequence["light"],
        "off_road": sequence["off_road"],
        "session": sequence["session"] or None,
        "spdx": spdx,
        "modalities": ",".join(name for name in MODALITIES if name in packed),
        "frames": len(frames["frame"]),
        "reviewed_frames": sum(state != "not_reviewed" for state in frames["label_state"]),
        "boxes_positive": sum(frames["boxes_positive"]),
        "boxes_negative": sum(frames["boxes_negative"]),
        "t_start_ns": min(starts, default=0),
        "t_end_ns": max(ends, default=0),
        "distance_m": distance_m,
        "files": len(members["file"]),
        "bytes": sum(members["size"]),
    }
