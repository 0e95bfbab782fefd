"""What cameras and front LiDAR observe of boards, without images: corners with pixel noise, and sweeps.

For what takes many boards or many noises: a detector's errors are left out, the sweeps are a session's.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import write_table
from card.geometry import apply, inverse
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.simulation import board
from card.simulation.board_scene import board_quads, place_board, surroundings
from card.simulation.board_sweep import sweep
from card.simulation.lidar import PERIOD_NS
from card.simulation.rig import CAMERAS, Rig

Array = NDArray[np.float64]

_VIEW_NS = 2_000_000_000
_TILT_DEG = 16.0
#: Share of the image, from below, in which the car itself is taken to be.
_CAR = 0.15


@dataclass(frozen=True)
class Observations:
    """V views.  t_ns : (V,).  pixels : (2, V, 40, 2) left and right.  bursts : a sweep each."""

    t_ns: NDArray[np.int64]
    pixels: Array
    bursts: list[Burst]


def board_places(rig: Rig, count: int, rng: np.random.Generator) -> Array:
    """Random poses ``rig_from_board`` (count, 4, 4), as a session has them."""
    car = {name: np.zeros((camera.height, camera.width), np.bool_) for name, camera in rig.cameras.items()}
    for mask in car.values():
        mask[round((1 - _CAR) * len(mask)) :] = True
    return np.array([place_board(rig, car, rng, tilt_deg=_TILT_DEG) for _ in range(count)])


def observe(
    rig: Rig, rig_from_board: Array, *, noise_px: float, columns: int, rng: np.random.Generator
) -> Observations:
    """Corners with noise (px, one sigma a coordinate) and a sweep of so many firings of each of V poses."""
    pixels = np.array(
        [
            [
                rig.cameras[name].project(apply(inverse(rig.rig_from[name]) @ pose, board.corners_m()))
                for pose in rig_from_board
            ]
            for name in CAMERAS
        ]
    )
    t_ns = _VIEW_NS * np.arange(1, len(rig_from_board) + 1)
    behind = surroundings(rng)
    bursts = [
        sweep(rig, [*behind, *board_quads(pose)], columns, number, int(time) - PERIOD_NS // 2, rng)
        for number, (time, pose) in enumerate(zip(t_ns, rig_from_board, strict=True))
    ]
    return Observations(t_ns, pixels + rng.normal(0, noise_px, pixels.shape), bursts)


def detections(observed: Observations, rig: Rig) -> dict[str, Any]:
    """The columns of table `board_detections`; views are named by their times."""
    camera = rig.cameras["camera_left"]
    count = observed.pixels.shape[2]
    views = 2 * len(observed.t_ns)
    stamps = np.tile(observed.t_ns, 2).repeat(count)
    return {
        "camera": np.repeat(CAMERAS, views // 2 * count).tolist(),
        "view": [str(stamp) for stamp in stamps],
        "t_ns": stamps,
        "corner": np.tile(np.arange(count, dtype=np.int32), views),
        "x_px": observed.pixels[..., 0].ravel(),
        "y_px": observed.pixels[..., 1].ravel(),
        "width_px": np.full(views * count, camera.width, dtype=np.int32),
        "height_px": np.full(views * count, camera.height, dtype=np.int32),
    }


def write_observations(observed: Observations, rig: Rig, *, session: Path, boards: Path) -> None:
    """Write the sweeps below a session's folder, and the corners as a table."""
    (session / "lidar_front").mkdir(parents=True)
    for burst in observed.bursts:
        write_burst(session / "lidar_front" / f"{burst.t_ns}.laz", burst)
    write_table(boards, detections(observed, rig), "board_detections")
