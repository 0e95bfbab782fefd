"""Where the estimation of the front LiDAR starts: the drawing, and the closed form over board planes."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.board import Board
from card.calibration.board_returns import Plane, find_plane, near_board
from card.calibration.plane_alignment import align_planes
from card.calibration.state import moved
from card.errors import CardError
from card.geometry import from_json, inverse
from card.recording.burst import Burst

Array = NDArray[np.float64]

#: The drawing is off by at most so many sigmas.
_SIGMAS = 4.0
_MARGIN_M = 0.05


@dataclass(frozen=True)
class Drawn:
    """The LiDAR's pose as drawn.  lidar_from_left : (4, 4).  sigma_m, sigma_rad : a coordinate, an axis."""

    lidar_from_left: Array
    sigma_m: float
    sigma_rad: float

    @classmethod
    def of(cls, drawing: Mapping[str, Any]) -> "Drawn":
        """Of a document of schema ``drawing``: both poses in the rig, and how far each may be off."""
        left, lidar = (drawing["extrinsics"][f"rig_from_{name}"] for name in ("camera_left", "lidar_front"))
        return cls(
            inverse(from_json(lidar)) @ from_json(left),
            float(np.hypot(left["sigma_m"], lidar["sigma_m"])),
            float(np.hypot(left["sigma_rad"], lidar["sigma_rad"])),
        )

    def slack_m(self, left_from_board: Array) -> float:
        """How far a board at this pose (4, 4) may be from where the drawing has it."""
        distance = float(np.linalg.norm(left_from_board[:3, 3]))
        return _MARGIN_M + _SIGMAS * (self.sigma_m + self.sigma_rad * distance)


def near_boards(
    sweeps: Iterable[Burst | None], left_from_board: Array, board: Board, drawn: Drawn
) -> Iterator[Burst | None]:
    """The sweeps, each with only those returns that may be of the board: a session's fit into memory."""
    for sweep, pose in zip(sweeps, left_from_board, strict=True):
        if sweep is None:
            yield None
            continue
        near = near_board(sweep.points, drawn.lidar_from_left @ pose, board, drawn.slack_m(pose))
        columns = {name: getattr(sweep, name)[near] for name in ("points", "intensity", "ring", "offset_ns")}
        yield Burst(t_ns=sweep.t_ns, **columns)


def board_planes(
    sweeps: Sequence[Burst | None],
    left_from_board: Array,
    board: Board,
    drawn: Drawn,
    settings: Mapping[str, Any],
) -> tuple[list[Plane | None], list[str]]:
    """The board's plane in each sweep, or None; and the reason, empty where there is one."""
    planes: list[Plane | None] = []
    reasons = []
    for sweep, pose in zip(sweeps, left_from_board, strict=True):
        plane, reason = None, "no sweep of the LiDAR at its time"
        if sweep is not None:
            expected, slack_rad = drawn.lidar_from_left @ pose, _SIGMAS * drawn.sigma_rad
            plane, reason = find_plane(
                sweep.points, expected, board, drawn.slack_m(pose), slack_rad, settings
            )
        planes.append(plane)
        reasons.append(reason)
    return planes, reasons


def starts(planes: Sequence[Plane | None], left_from_board: Array, drawn: Drawn, count: int) -> list[Array]:
    """Starts of ``lidar_from_left``: the closed form, the drawing, the drawing disturbed by its sigmas."""
    seen = [(plane, pose) for plane, pose in zip(planes, left_from_board, strict=True) if plane is not None]
    normals = np.array([pose[:3, 2] for _, pose in seen])
    closed = align_planes(
        np.array([plane.normal for plane, _ in seen]),
        np.array([plane.offset for plane, _ in seen]),
        normals,
        np.array([normal @ pose[:3, 3] for normal, (_, pose) in zip(normals, seen, strict=True)]),
    )
    rng = np.random.default_rng(0)
    sigmas = [drawn.sigma_m] * 3 + [drawn.sigma_rad] * 3
    disturbed = [moved(drawn.lidar_from_left, rng.normal(0, sigmas)) for _ in range(count - 2)]
    return [closed, drawn.lidar_from_left, *disturbed]


def check_planes(
    names: Sequence[str], planes: Sequence[Plane | None], reasons: Sequence[str], least: int, where: object
) -> None:
    """Enough views have a plane, and most do."""
    found = sum(plane is not None for plane in planes)
    if found < max(least, len(planes) / 2):
        name, reason = next((n, r) for n, r in zip(names, reasons, strict=True) if r)
        raise CardError(
            "too few views with returns of the board",
            where=where,
            found=f"{found} of {len(planes)}; view {name}: {reason}",
            wanted=f"{least} or more, and half of the views",
        )
