"""Heights over the local road plane, and back."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.errors import CardError
from card.geometry.trajectory import ROTATION_COLUMNS, TRANSLATION_COLUMNS, Trajectory
from card.geometry.transforms import apply, inverse, quaternion_from_matrix, transform

Array = NDArray[np.float64]


def height_above_road(points_rig: ArrayLike, road_from_rig: ArrayLike) -> Array:
    """Signed heights (N,) in metres of points (N, 3) in rig over a road plane.

    road_from_rig : (4, 4), of the frame's row in ``road_planes.parquet``; Z is the height. Paper, supplement,
    "Height Evaluation Metrics".
    """
    return apply(road_from_rig, points_rig)[..., 2]


def points_above_road(points_rig: ArrayLike, height_m: ArrayLike, road_from_rig: ArrayLike) -> Array:
    """Points (N, 3) in rig over the same spots of the road plane as points (N, 3), at heights (N,), metres.

    The inverse of `height_above_road`: what it says of the result is `height_m`.
    """
    road = apply(road_from_rig, points_rig)
    road[..., 2] = height_m
    return apply(inverse(road_from_rig), road)


@dataclass(frozen=True)
class Roads:
    """The road planes of a sequence's F frames: frame and t_ns (F,), road_from_rig (F, 4, 4), valid (F,)."""

    frame: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    road_from_rig: Array
    valid: NDArray[np.bool_]

    @classmethod
    def from_table(cls, table: Any) -> "Roads":
        """The planes of a table of schema ``road_planes``."""
        columns = {
            name: np.asarray(table[name])
            for name in ("frame", "t_ns", "valid", *TRANSLATION_COLUMNS, *ROTATION_COLUMNS)
        }
        translation, rotation = (
            np.stack([columns[name] for name in names], axis=1)
            for names in (TRANSLATION_COLUMNS, ROTATION_COLUMNS)
        )
        return cls(
            columns["frame"].astype(np.int64),
            columns["t_ns"].astype(np.int64),
            transform(translation, rotation),
            columns["valid"].astype(np.bool_),
        )

    def by_frame(self) -> Mapping[int, Array]:
        """road_from_rig (4, 4) of the frames with a valid plane."""
        return {
            int(frame): road
            for frame, road, valid in zip(self.frame, self.road_from_rig, self.valid, strict=True)
            if valid
        }

    def at(self, t_ns: int) -> Array:
        """road_from_rig (4, 4) at a time: of its frame, or between the frames before and after.

        Raises
        ------
        CardError
            If the time lies outside the frames or a plane beside it is not valid.
        """
        after = int(np.searchsorted(self.t_ns, t_ns))
        beside = [after] if after < len(self.t_ns) and self.t_ns[after] == t_ns else [after - 1, after]
        if beside[0] < 0 or beside[-1] >= len(self.t_ns) or not self.valid[beside].all():
            raise CardError("no road plane at a time", found=t_ns, wanted="between frames with valid planes")
        if len(beside) == 1:
            return self.road_from_rig[after]
        return self._path.at(t_ns)

    def height_above_road(self, points_rig: ArrayLike, t_ns: int) -> Array:
        """Signed heights (N,) in metres of points (N, 3) in rig over the road at a time; see `at`."""
        return height_above_road(points_rig, self.at(t_ns))

    def points_above_road(self, points_rig: ArrayLike, height_m: ArrayLike, t_ns: int) -> Array:
        """Points (N, 3) in rig over the same spots of the road at heights (N,) metres; see `at`."""
        return points_above_road(points_rig, height_m, self.at(t_ns))

    @cached_property
    def _path(self) -> Trajectory:
        return Trajectory(
            self.t_ns, self.road_from_rig[:, :3, 3], quaternion_from_matrix(self.road_from_rig[:, :3, :3])
        )
