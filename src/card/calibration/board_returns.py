"""Returns of a LiDAR that are of the board, told from what is behind, around and below it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.board import Board
from card.geometry import apply, inverse

Array = NDArray[np.float64]

_HYPOTHESES = 120
#: Beyond what the drawing allows, degrees: three returns that are near each other make a poor normal.
_NORMAL_DEG = 10.0
#: A board shows at least this share of its width and of its height: it may reach beyond what is scanned.
_SHOWN = 0.25
_TAILS = (3, 97)  # percentiles: what holds the board may lie in its plane


@dataclass(frozen=True)
class Plane:
    """normal @ point = offset in the LiDAR frame.

    normal : (3,) away from the LiDAR.  offset : metres.  returns : ordinals of the sweep's points on it.
    """

    normal: Array
    offset: float
    returns: NDArray[np.intp]


def find_plane(
    points: Array,
    lidar_from_board: Array,
    board: Board,
    slack_m: float,
    slack_rad: float,
    settings: Mapping[str, Any],
) -> tuple[Plane | None, str]:
    """The board's plane among returns (N, 3), or None and why there is none.

    It is the plane with most returns, about where the board is expected and about as it is turned, that is
    not larger than the plate: a wall goes on, whatever part of it is looked at.

    lidar_from_board : (4, 4), expected; off by at most the slacks, m and rad.
    settings : section ``front_lidar`` of the stage's settings.
    """
    left = np.flatnonzero(near_board(points, lidar_from_board, board, slack_m))
    least, reason = settings["min_returns"], "no returns of a plane where the board should be"
    expected = lidar_from_board[:3, 2]
    most_apart = np.cos(min(slack_rad + np.radians(_NORMAL_DEG), np.pi / 2))
    rng = np.random.default_rng(0)
    while len(left) >= least:
        inside = _largest_plane(points[left], expected, most_apart, settings["plane_tolerance_m"], rng)
        if inside.sum() < least:
            break
        normal, offset, extent = _fitted(points[left[inside]], lidar_from_board)
        if (extent > board.size_m + settings["outline_slack_m"]).any():
            reason = "returns are of a plane that goes on beyond the board, {:.2f} x {:.2f} m".format(*extent)
        elif (extent < _SHOWN * board.size_m).any():
            reason = "returns are of a plane that is too small for the board, {:.2f} x {:.2f} m".format(
                *extent
            )
        elif normal @ expected >= most_apart:
            return Plane(normal, offset, left[inside]), ""
        left = left[~inside]
    return None, reason


def on_board(
    points: Array, lidar_from_board: Array, board: Board, settings: Mapping[str, Any]
) -> NDArray[np.bool_]:
    """Which returns (N, 3) are on the plate, its rim left out, within the tolerance of its plane: (N,)."""
    local = apply(inverse(lidar_from_board), points) - board.centre_m
    half = board.size_m / 2 - settings["edge_m"]
    inside: NDArray[np.bool_] = (np.abs(local[:, :2]) < half).all(axis=1)
    return inside & (np.abs(local[:, 2]) < settings["plane_tolerance_m"])


def near_board(points: Array, lidar_from_board: Array, board: Board, slack_m: float) -> NDArray[np.bool_]:
    """Which points (N, 3) are where the plate may be: (N,)."""
    local = np.abs(apply(inverse(lidar_from_board), points) - board.centre_m)
    return np.asarray((local < np.array([*(board.size_m / 2), 0.0]) + slack_m).all(axis=1))


def _largest_plane(
    points: Array, expected: Array, cosine: float, tolerance_m: float, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Which returns (N,) are near the plane that most are near, of planes through three of them."""
    triples = points[rng.integers(0, len(points), (_HYPOTHESES, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    length = np.linalg.norm(normals, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        normals /= length[:, None]
    fits = (length > 1e-6) & (np.abs(normals @ expected) >= cosine)
    if not fits.any():
        return np.zeros(len(points), dtype=np.bool_)
    normals, through = normals[fits], triples[fits, 0]
    near = np.abs(normals @ points.T - np.sum(normals * through, axis=1)[:, None]) < tolerance_m
    best = near[int(np.argmax(near.sum(axis=1)))]
    for _ in range(2):
        centre = points[best].mean(axis=0)
        normal = np.linalg.svd(points[best] - centre, full_matrices=False)[2][2]
        refit = np.abs((points - centre) @ normal) < tolerance_m
        best = refit if refit.sum() >= 3 else best
    return np.asarray(best)


def _fitted(points: Array, lidar_from_board: Array) -> tuple[Array, float, Array]:
    """Normal and offset of the plane of returns (N, 3), and their reach (2,) along the board's sides, m."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    normal = normal if normal @ lidar_from_board[:3, 2] > 0 else -normal
    low, high = np.percentile((points - centre) @ lidar_from_board[:3, :2], _TAILS, axis=0)
    return normal, float(normal @ centre), high - low
