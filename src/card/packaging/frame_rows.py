"""Columns of the released frame table, apart from the split."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from card.artifacts import load_schema
from card.packaging.modalities import CAMERAS, LIDARS, Entry, Rows

SCHEMA = "package_frames"


def frame_columns(
    sequence: Mapping[str, Any],
    spdx: str,
    frames: Rows,
    entries: Mapping[str, Sequence[Entry]],
    states: Rows,
    boxes: Rows,
    coverage: Rows,
) -> dict[str, list[Any]]:
    """One row for each frame: what it is, what of it is in the shards, and what is known about it.

    `entries` are the packed members by modality; a LiDAR burst counts for a frame when it was packed.
    """
    packed = {modality: {entry.frame for entry in found} for modality, found in entries.items()}
    bursts = {lidar: {entry.burst for entry in entries.get(lidar, ())} for lidar in LIDARS}
    state_of = {row["frame"]: row["state"] for row in states}
    counts = Counter((box["frame"], box["class"]) for box in boxes)
    covered = {row["frame"]: row for row in coverage}

    rows = []
    for row in frames:
        frame = row["frame"]
        known = covered.get(frame, {}) if frame in packed.get("ground_truth", ()) else {}
        rows.append(
            {
                "sequence": sequence["id"],
                "frame": frame,
                "t_ns": row["t_ns"],
                "right_t_ns": row["right_t_ns"],
                "country": sequence["country"],
                "place": sequence["place"],
                "road_type": sequence["road_type"],
                "light": sequence["light"],
                "off_road": sequence["off_road"],
                "session": sequence["session"] or None,
                **{f"has_{camera}": frame in packed.get(camera, ()) for camera in CAMERAS},
                **{f"has_{lidar}": row[f"{lidar}_burst"] in bursts[lidar] for lidar in LIDARS},
                "has_ground_truth": frame in packed.get("ground_truth", ()),
                "has_labels": frame in packed.get("labels", ()),
                **{f"{lidar}_burst": row[f"{lidar}_burst"] for lidar in LIDARS},
                "label_state": state_of.get(frame, "not_reviewed"),
                "boxes_positive": counts[frame, "positive"],
                "boxes_negative": counts[frame, "negative"],
                "gt_points": known.get("points_saved"),
                "gt_image_share": known.get("image_share"),
                "gt_window_share": known.get("window_share"),
                "gt_flag": known.get("flag"),
                "spdx": spdx,
            }
        )
    return {name: [row[name] for row in rows] for name in load_schema(SCHEMA)["columns"]}
