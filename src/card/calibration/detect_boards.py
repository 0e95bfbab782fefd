"""The board in every stereo pair of a calibration session or of a survey."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure, progress, write_report, write_table
from card.artifacts.processes import in_processes
from card.calibration.board import Board
from card.calibration.chessboard import find_chessboard
from card.calibration.spread import spread
from card.calibration.stereo_views import View, list_views
from card.errors import CardError
from card.recording.paths import CAMERAS, stamp_of

BOARD = "board.yaml"
_SAMPLE = 12


@dataclass(frozen=True)
class Seen:
    """What one image shows.  corners : (N, 2) px, or None for the reason.  size : width and height, px."""

    corners: NDArray[np.float64] | None
    reason: str
    size: tuple[int, int]


def detect_boards(
    *,
    session: Path,
    boards: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    threads: int,
) -> None:
    """Write the inner corners of the board in each image as table `board_detections`.

    A view is named by the time of its left image; that of a survey by its folder, ``survey-<n>/pose-<m>``.
    An image without a board, with a blurred one, or with one that goes on beyond the pattern has no corners;
    a note of the report names the view and the reason.

    Parameters
    ----------
    session : folder with board.yaml and camera_left|camera_right/<t_ns>.jpg, or such folders of images in
        survey-<n>/pose-<m>/.
    threads : processes that share the work; the bytes do not depend on it.

    Raises
    ------
    CardError
        If there are no pairs, images of a camera differ in size, or no view shows the board to both cameras.
    """
    board = Board.read(session / BOARD)
    views, notes = list_views(session, settings["boards"]["max_stereo_delay_ms"])
    jobs = [(view, side) for view in views for side in range(2)]

    def look(job: tuple[View, int]) -> Seen:
        return _look(job[0].images[job[1]], board, settings["boards"])

    _check_sample(jobs, look, session, board)
    found = list(progress(in_processes(look, jobs, threads), f"boards of {session.name}", len(jobs)))
    _check_sizes(jobs, found)
    refused = [
        f"{CAMERAS[side]} of view {view.name}: {seen.reason}"
        for (view, side), seen in zip(jobs, found, strict=True)
        if seen.corners is None
    ]
    both = sum(
        left.corners is not None and right.corners is not None
        for left, right in zip(found[::2], found[1::2], strict=True)
    )
    if both == 0:
        raise _no_board(session, refused[0], board)
    write_table(boards, _columns(jobs, found), "board_detections")
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs={"board": session / BOARD},
        counts={"views": len(views), "views_with_board": both, "images_refused": len(refused)},
        figures=[
            Figure(
                "board_found_pct",
                100 * both / len(views),
                "%",
                "share of the stereo pairs in which both images show the board",
            )
        ],
        gates=gates,
        notes=notes + refused,
    )


def _check_sample(
    jobs: Sequence[tuple[View, int]], look: Callable[[tuple[View, int]], Seen], session: Path, board: Board
) -> None:
    """A few images, spread over the session, show the board: else all the others would be searched in vain.

    A search in vain takes many times longer than one that finds the board.
    """
    few = [jobs[i] for i in spread(len(jobs), _SAMPLE)]
    reason = ""
    for view, side in few:
        seen = look((view, side))
        if seen.corners is not None:
            return
        reason = reason or f"{CAMERAS[side]} of view {view.name}: {seen.reason}"
    raise _no_board(session, reason, board)


def _no_board(session: Path, reason: str, board: Board) -> CardError:
    return CardError(
        "no view shows the board to both cameras",
        where=session,
        found=reason,
        wanted=f"{board.columns} x {board.rows} inner corners, as {BOARD} says",
    )


def _look(path: Path, board: Board, settings: Mapping[str, Any]) -> Seen:
    image: Any = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise CardError("unreadable image", where=path)
    corners, reason = find_chessboard(image, board.columns, board.rows, settings)
    return Seen(corners, reason, (image.shape[1], image.shape[0]))


def _check_sizes(jobs: Sequence[tuple[View, int]], found: Sequence[Seen]) -> None:
    for (view, side), seen in zip(jobs, found, strict=True):
        if seen.size != found[0].size:
            raise CardError(
                f"{CAMERAS[side]} of view {view.name} has another size than the first image",
                where=view.images[side],
                found="{} x {}".format(*seen.size),
                wanted="{} x {}".format(*found[0].size),
            )


def _columns(jobs: Sequence[tuple[View, int]], found: Sequence[Seen]) -> dict[str, Any]:
    kept = [
        (view, side, seen, seen.corners)
        for (view, side), seen in zip(jobs, found, strict=True)
        if seen.corners is not None
    ]
    count = len(kept[0][3])
    pixels = np.concatenate([corners for *_, corners in kept])
    return {
        "camera": [CAMERAS[side] for _, side, *_ in kept for _ in range(count)],
        "view": [view.name for view, *_ in kept for _ in range(count)],
        "t_ns": np.repeat([stamp_of(view.images[side]) for view, side, *_ in kept], count),
        "corner": np.tile(np.arange(count, dtype=np.int32), len(kept)),
        "x_px": pixels[:, 0],
        "y_px": pixels[:, 1],
        "width_px": np.full(len(pixels), found[0].size[0], dtype=np.int32),
        "height_px": np.full(len(pixels), found[0].size[1], dtype=np.int32),
    }
