"""The bursts and images of a sequence and their poses."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, to_json

Integers = NDArray[np.int64]
LIDARS = ("lidar_front", "lidar_rear")


@dataclass(frozen=True)
class Members:
    """What a trajectory has to cover, by sensor.

    bursts : LiDAR to numbers (M,) and times (M, 2) of start and end, ns.
    images : camera to frame numbers (M,) and mid-exposure times (M,), ns.
    """

    bursts: Mapping[str, tuple[Integers, Integers]]
    images: Mapping[str, tuple[Integers, Integers]]


def read_members(bursts: Any, frames: Any) -> Members:
    """The members in tables of schemas ``bursts`` and ``frames``."""
    lidar = np.asarray(bursts["lidar"])
    number = np.asarray(bursts["burst"], dtype=np.int64)
    span = np.stack([np.asarray(bursts["t_start_ns"]), np.asarray(bursts["t_end_ns"])], axis=1)
    of_lidar = {
        name: (number[lidar == name], span[lidar == name]) for name in LIDARS if (lidar == name).any()
    }
    frame = np.asarray(frames["frame"], dtype=np.int64)
    images = {"camera_left": (frame, np.asarray(frames["t_ns"], dtype=np.int64))} if len(frame) else {}
    paired = np.array([stamp is not None for stamp in frames["right_t_ns"].to_pylist()], dtype=bool)
    if paired.any():
        right = np.array(frames["right_t_ns"].drop_null().to_pylist(), dtype=np.int64)
        images["camera_right"] = (frame[paired], right)
    return Members(of_lidar, images)


def pose_document(members: Members, trajectory: Trajectory) -> dict[str, Any]:
    """The document of schema ``poses``: world_from_rig at every burst end and image, in order of time."""
    kinds = [("burst_end", name, numbers, spans[:, 1]) for name, (numbers, spans) in members.bursts.items()]
    kinds += [("image", name, numbers, times) for name, (numbers, times) in members.images.items()]
    rows = [
        {"kind": kind, "sensor": sensor, "index": int(index), "t_ns": int(t_ns), **to_json(pose)}
        for kind, sensor, numbers, times in kinds
        for index, t_ns, pose in zip(numbers, times, trajectory.at(times), strict=True)
    ]
    rows.sort(key=lambda row: (row["t_ns"], row["sensor"]))
    return {"schema": "poses", "poses": rows}
