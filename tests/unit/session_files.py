"""Calibration sessions on disk, without images: what benchmarks/board_sessions.py simulates."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from board_sessions import (
    BOARD,
    DAY,
    NOISE_PX,
    left_from_right,
    lidar_from,
    places,
    rig_of,
    views_of,
)

from card.artifacts import default_settings, write_json
from card.simulation.board_images import write_board_yaml
from card.simulation.board_observations import Observations, observe, write_observations
from card.simulation.drawing import drawing
from card.simulation.rig import Rig

__all__ = ["BOARD", "DAY", "NOISE_PX", "left_from_right", "lidar_from", "places", "rig_of", "views_of"]


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


def observations(seed: int, count: int, columns: int = 400) -> Observations:
    rng = np.random.default_rng([seed, 2])
    return observe(rig_of(seed), places(seed, count), noise_px=NOISE_PX, columns=columns, rng=rng)


def save(folder: Path, observed: Observations, rig: Rig) -> Session:
    session = Session(folder, rig, observed)
    folder.mkdir(parents=True, exist_ok=True)
    write_board_yaml(folder)
    write_observations(observed, rig, session=folder, boards=session.boards)
    write_json(session.drawing, drawing("full"), "drawing")
    return session
