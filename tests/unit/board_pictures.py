"""Pictures of boards for the tests of the detector: drawn by ray, small, in milliseconds."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
from session_files import DAY

from card.simulation.board_images import write_board_yaml
from card.simulation.board_observations import board_places
from card.simulation.board_scene import board_quads
from card.simulation.quads import QuadView
from card.simulation.rig import CAMERAS, Rig, built_rig

SIDE = 620
_DELAY_NS = 200_000
_VIEW_NS = 1_000_000_000


@cache
def small_rig() -> Rig:
    return built_rig(DAY, 1, SIDE, SIDE)


@cache
def view_of(camera: str) -> QuadView:
    rig = small_rig()
    return QuadView(rig.cameras[camera], rig.rig_from[camera], samples=2)


@cache
def poses(count: int) -> np.ndarray:
    return board_places(small_rig(), count, np.random.default_rng(7))


@cache
def picture(camera: str, count: int, number: int) -> np.ndarray:
    """The grey picture of view ``number`` of so many."""
    return tones(view_of(camera), poses(count)[number], number)


def tones(view: QuadView, pose: np.ndarray, seed: int) -> np.ndarray:
    light = view.draw(board_quads(pose))
    noisy = 255 * light.mean(axis=2) ** (1 / 2.2) + np.random.default_rng(seed).normal(0, 2, light.shape[:2])
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def stamps(number: int) -> dict[str, int]:
    left = (number + 1) * _VIEW_NS
    return dict(zip(CAMERAS, (left, left + _DELAY_NS), strict=True))


def write_session(folder: Path, count: int) -> Path:
    write_board_yaml(folder)
    for number in range(count):
        for camera, t_ns in stamps(number).items():
            write_picture(folder / camera / f"{t_ns}.jpg", picture(camera, count, number))
    return folder


def write_picture(path: Path, pixels: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])
