"""Board sessions without images for the tests of the calibration: one place for their rigs and settings."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import default_settings, write_json
from card.calibration.board import Board
from card.calibration.board_views import BoardViews
from card.geometry import inverse
from card.simulation import board
from card.simulation.board_images import write_board_yaml
from card.simulation.board_observations import Observations, board_places, observe, write_observations
from card.simulation.drawing import drawing
from card.simulation.rig import Rig, built_rig

BOARD = Board(*board.INNER_CORNERS, board.SQUARE_M, np.array(board.SIZE_M), np.array(board.PLATE_CORNER_M))
DAY = "2026-04-14"
WIDTH, HEIGHT = 2248, 2252
#: Twice what the detector errs by on simulated images of full size.
NOISE_PX = 0.05


@dataclass(frozen=True)
class Session:
    """A session on disk, and the car it shows."""

    folder: Path
    rig: Rig
    observed: Observations

    @property
    def boards(self) -> Path:
        return self.folder / "boards.parquet"

    @property
    def board(self) -> Path:
        return self.folder / "board.yaml"

    @property
    def drawing(self) -> Path:
        return self.folder / "drawing.json"


def settings(**front_lidar: Any) -> dict[str, Any]:
    document = default_settings("calibration")
    document["front_lidar"] |= front_lidar
    return document


@cache
def places(seed: int, count: int) -> np.ndarray:
    """Poses of the board before the car of a seed."""
    return board_places(rig_of(seed), count, np.random.default_rng([seed, 1]))


def rig_of(seed: int) -> Rig:
    return built_rig(DAY, seed, WIDTH, HEIGHT)


def observations(seed: int, count: int, columns: int = 400, rig: Rig | None = None) -> Observations:
    rig = rig or rig_of(seed)
    rng = np.random.default_rng([seed, 2])
    return observe(rig, places(seed, count), noise_px=NOISE_PX, columns=columns, rng=rng)


def save(folder: Path, observed: Observations, rig: Rig) -> Session:
    session = Session(folder, rig, observed)
    folder.mkdir(parents=True, exist_ok=True)
    write_board_yaml(folder)
    write_observations(observed, rig, session=folder, boards=session.boards)
    write_json(session.drawing, drawing("full"), "drawing")
    return session


def views_of(observed: Observations, rig: Rig) -> BoardViews:
    """The views as the detector would give them."""
    camera = rig.cameras["camera_left"]
    names = tuple(str(t_ns) for t_ns in observed.t_ns)
    return BoardViews(names, observed.t_ns, observed.pixels, (camera.width, camera.height))


def left_from_right(rig: Rig) -> np.ndarray:
    return inverse(rig.rig_from["camera_left"]) @ rig.rig_from["camera_right"]


def lidar_from(rig: Rig, camera: str) -> np.ndarray:
    return inverse(rig.rig_from["lidar_front"]) @ rig.rig_from[camera]
