"""The joint estimate of cameras, board poses and front LiDAR over a session."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from card.calibration.board import Board
from card.calibration.board_returns import on_board
from card.calibration.board_views import BoardViews
from card.calibration.camera_estimate import CAMERA_COLUMNS
from card.calibration.corner_residuals import Corners
from card.calibration.lidar_start import Drawn, board_planes, check_planes, starts
from card.calibration.return_residuals import BoardReturns
from card.calibration.robust_least_squares import Problem, Solution, solve
from card.calibration.spread import spread
from card.calibration.state import CHANNELS, CORRECTIONS, LIDAR, RANGE, Array, State, step_between
from card.recording.burst import Burst

#: A return that grazes the board says little of its plane: no less a cosine divides.
_LEAST_COSINE = 0.1
_LIDAR_COLUMNS = np.arange(LIDAR.start, LIDAR.stop)
_START_COLUMNS = np.concatenate([_LIDAR_COLUMNS, [RANGE.start]])
_ALL_COLUMNS = np.concatenate(
    [CAMERA_COLUMNS, _LIDAR_COLUMNS, np.arange(CORRECTIONS.start, CORRECTIONS.stop)]
)


@dataclass(frozen=True)
class FrontLidar:
    """What came of a session.

    views : (V) those that the cameras were calibrated with.
    reasons : why a view's returns are not used, empty where they are.
    closed_form : ``lidar_from_left`` (4, 4) of the closed form.
    starts, starts_agreed : poses tried, and those that led to the pose of the best.
    half_step : (6,) from the LiDAR's pose of every other view to that of the rest.
    cosine : (V, M) of incidence of the returns.
    """

    views: BoardViews
    reasons: tuple[str, ...]
    solution: Solution
    cosine: Array
    closed_form: Array
    starts: int
    starts_agreed: int
    half_step: Array


def estimate_front_lidar(
    views: BoardViews,
    sweeps: Sequence[Burst | None],
    cameras: State,
    board: Board,
    drawn: Drawn,
    settings: Mapping[str, Any],
    where: object,
) -> FrontLidar:
    """The joint estimate; settings : section ``front_lidar`` and ``corner_sigma_px``."""
    planes, reasons = board_planes(sweeps, cameras.left_from_board, board, drawn, settings)
    check_planes(views.names, planes, reasons, settings["min_views"], where)
    tried = starts(planes, cameras.left_from_board, drawn, settings["starts"])
    best, agreed = _best_start(views, sweeps, planes, cameras, tried, board, settings)
    chosen = []
    for i, (sweep, pose) in enumerate(zip(sweeps, cameras.left_from_board, strict=True)):
        returns = np.zeros(0, dtype=np.intp)
        if sweep is not None and planes[i] is not None:
            returns = np.flatnonzero(on_board(sweep.points, best.lidar_from_left @ pose, board, settings))
            if len(returns) < settings["min_returns"]:
                tolerance = settings["plane_tolerance_m"]
                reasons[i] = (
                    f"{len(returns)} returns within {tolerance:g} m of the board: those found lie elsewhere"
                )
                returns = returns[:0]
        chosen.append(returns)
    check_planes(
        views.names,
        [p if len(r) else None for p, r in zip(planes, chosen, strict=True)],
        reasons,
        settings["min_views"],
        where,
    )
    block = returns_block(sweeps, chosen, best, settings["max_returns"])
    solution = solve(best, _problem(views, block, board, _ALL_COLUMNS, settings))
    halves = []
    for part in range(2):
        half = np.flatnonzero([len(returns) > 0 for returns in chosen])[part::2]
        problem = _problem(views.of(half), _of_views(block, half), board, _ALL_COLUMNS, settings)
        halves.append(solve(solution.state.of_views(half), problem).state.lidar_from_left)
    return FrontLidar(
        views,
        tuple(reasons),
        solution,
        block.cosine,
        tried[0],
        len(tried),
        agreed,
        step_between(halves[0], halves[1]),
    )


def _best_start(
    views: BoardViews,
    sweeps: Sequence[Burst | None],
    planes: Sequence[Any],
    cameras: State,
    tried: Sequence[Array],
    board: Board,
    settings: Mapping[str, Any],
) -> tuple[State, int]:
    """The cameras' state with the LiDAR where the best start led to, and how many starts led there."""
    seen = np.flatnonzero([plane is not None for plane in planes])
    some = seen[spread(len(seen), settings["start_views"])]
    part, views = cameras.of_views(some), views.of(some)
    found = []
    for pose in tried:
        start = replace(part, lidar_from_left=pose)
        block = returns_block(
            [sweeps[i] for i in some], [planes[i].returns for i in some], start, settings["max_returns"]
        )
        solution = solve(start, _problem(views, block, board, _START_COLUMNS, settings))
        found.append((solution.sigmas[-1], solution.state))
    best = min(found, key=lambda pair: pair[0])[1]
    steps = np.array([step_between(best.lidar_from_left, state.lidar_from_left) for _, state in found])
    agreed = np.degrees(np.linalg.norm(steps[:, 3:], axis=1)) <= settings["max_start_deg"]
    agreed &= 1e3 * np.linalg.norm(steps[:, :3], axis=1) <= settings["max_start_mm"]
    whole = replace(cameras, lidar_from_left=best.lidar_from_left, corrections=best.corrections)
    return whole, int(agreed.sum())


def returns_block(
    sweeps: Sequence[Burst | None], chosen: Sequence[Any], state: State, most: int
) -> BoardReturns:
    """The chosen returns of each sweep, by ordinal, at most so many a view and then evenly taken."""
    chosen = [returns[spread(len(returns), most)] if len(returns) else returns for returns in chosen]
    count = max(1, *(len(returns) for returns in chosen))
    points, ring = np.full((len(chosen), count, 3), np.nan), np.zeros((len(chosen), count), dtype=np.uint8)
    for i, (sweep, returns) in enumerate(zip(sweeps, chosen, strict=True)):
        if sweep is not None:
            points[i, : len(returns)] = sweep.points[returns]
            ring[i, : len(returns)] = sweep.ring[returns]
    normal = (state.lidar_from_left @ state.left_from_board)[:, :3, 2]
    along = np.abs(np.einsum("vi,vmi->vm", normal, points)) / np.linalg.norm(points, axis=-1)
    return BoardReturns(points, ring, np.maximum(along, _LEAST_COSINE))


def _of_views(block: BoardReturns, chosen: Any) -> BoardReturns:
    return BoardReturns(block.points[chosen], block.ring[chosen], block.cosine[chosen])


def _problem(
    views: BoardViews, block: BoardReturns, board: Board, free: Any, settings: Mapping[str, Any]
) -> Problem:
    prior = [settings["channel_range_sigma_m"]] * CHANNELS + [settings["channel_angle_sigma_rad"]] * (
        2 * CHANNELS
    )
    return Problem(
        blocks=[*(Corners(side, board.corners_m, views.pixels[side]) for side in range(2)), block],
        sigmas=[settings["corner_sigma_px"]] * 2 + [settings["range_sigma_m"]],
        free=free,
        huber=settings["huber_sigmas"],
        prior_sigma=np.array([settings["range_offset_sigma_m"], *prior]),
    )
