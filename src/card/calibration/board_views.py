"""The detected corners of the views in which both cameras see the board."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_table
from card.calibration.board import Board
from card.errors import CardError
from card.recording.paths import CAMERAS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BoardViews:
    """V views of N corners.

    names : of the views.  t_ns : (V,) of the left images.
    pixels : (2, V, N, 2) in the left and the right image.
    size : width and height of the images, px.
    """

    names: tuple[str, ...]
    t_ns: NDArray[np.int64]
    pixels: Array
    size: tuple[int, int]

    def __len__(self) -> int:
        return len(self.names)

    def of(self, chosen: NDArray[Any]) -> "BoardViews":
        """Some of the views, by index or mask."""
        index = np.arange(len(self))[chosen]
        names = tuple(self.names[i] for i in index)
        return BoardViews(names, self.t_ns[index], self.pixels[:, index], self.size)


def read_board_views(path: Path, board: Board) -> BoardViews:
    """Views of table `board_detections` that both cameras share, in the table's order.

    Raises
    ------
    CardError
        If a view lacks corners of the board, images differ in size, or no view has both cameras.
    """
    table = read_table(path, "board_detections").to_pydict()
    sizes = set(zip(table["width_px"], table["height_px"], strict=True))
    if len(sizes) > 1:
        raise CardError("images differ in size", where=path, found=sorted(sizes))
    corners: dict[tuple[str, str], list[int]] = {}
    for row, key in enumerate(zip(table["camera"], table["view"], strict=True)):
        corners.setdefault(key, []).append(row)
    count, number = board.columns * board.rows, table["corner"]
    for (camera, view), rows in corners.items():
        if [number[row] for row in rows] != list(range(count)):
            raise CardError(
                f"{camera} of view {view} has not the corners of the board",
                where=path,
                found=len(rows),
                wanted=f"{count}, in order",
            )
    both = [view for camera, view in corners if camera == CAMERAS[0] and (CAMERAS[1], view) in corners]
    if not both:
        raise CardError("no view shows the board to both cameras", where=path)
    pixels = np.stack([table["x_px"], table["y_px"]], axis=-1)
    return BoardViews(
        tuple(both),
        np.array([table["t_ns"][corners[CAMERAS[0], view][0]] for view in both], dtype=np.int64),
        np.array([[pixels[corners[camera, view]] for view in both] for camera in CAMERAS]),
        sizes.pop(),
    )
