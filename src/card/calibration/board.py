"""The calibration board as `board.yaml` describes it.

Board frame: origin at the first inner corner, x along a row of corners, y down the rows, z away from the
viewer.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_yaml
from card.errors import CardError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Board:
    """A chessboard on a plate.

    columns, rows : inner corners a row, and rows of them.
    square_m : side of a square.
    size_m : width and height of the plate (2,).
    plate_corner_m : the plate's upper left corner in the board frame (2,).
    """

    columns: int
    rows: int
    square_m: float
    size_m: Array
    plate_corner_m: Array

    @classmethod
    def read(cls, path: Path) -> "Board":
        """The board of a file (schema ``board``).

        Raises
        ------
        CardError
            If both counts of corners are even or both are odd: then the pattern has no first corner.
        """
        document = read_yaml(path, "board")
        columns, rows = document["inner_corners"]
        if (columns + rows) % 2 == 0:
            raise CardError(
                "board looks the same upside down",
                where=path,
                found=f"{columns} x {rows} inner corners",
                wanted="an even and an odd count",
            )
        return cls(
            columns,
            rows,
            float(document["square_m"]),
            np.array(document["size_m"], dtype=np.float64),
            np.array(document["plate_corner_m"], dtype=np.float64),
        )

    @property
    def corners_m(self) -> Array:
        """Inner corners (columns * rows, 3) in the board frame, row by row."""
        y, x = np.mgrid[0 : self.rows, 0 : self.columns]
        return self.square_m * np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float64)

    @property
    def centre_m(self) -> Array:
        """Middle of the plate (3,) in the board frame."""
        return np.array([*(self.plate_corner_m + self.size_m / 2), 0.0])
