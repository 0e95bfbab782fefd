"""Where a board is held before a standing car, and what else is there: ground, wall, clutter."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import (
    CameraModel,
    apply,
    inverse,
    matrix_from_quaternion,
    quaternion_from_matrix,
    transform,
)
from card.simulation import board
from card.simulation.quads import Quad
from card.simulation.rig import CAMERAS, RIG_HEIGHT_M, Rig, lidar_elevations_rad

Array = NDArray[np.float64]
Masks = Mapping[str, NDArray[np.bool_]]

NEAR_M = 1.4
FAR_M = 6.0
#: A detector wants this many pixels a square, foreshortened; a tiny image has to do with less.
_SQUARE_PX = 8.0
_SQUARE_SHARE = 0.065  # of the focal length
_BORDER_PX = 4
_GROUND_Z_M = -RIG_HEIGHT_M
_TRIES = 20_000

# Axes of a board that stands upright before the car: x right, y down, z away (columns, in the rig).
_UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def resolvable_px(camera: CameraModel) -> float:
    """Least pixels a square at which the pattern is shown to a camera."""
    return min(_SQUARE_PX, _SQUARE_SHARE * camera.fx)


def place_board(rig: Rig, ego: Masks, rng: np.random.Generator, *, tilt_deg: float) -> Array:
    """A pose ``rig_from_board`` (4, 4) that both cameras see whole and the front LiDAR hits.

    ego : (height, width) by camera, pixels that show the car itself; the board keeps clear of them.
    tilt_deg : one sigma of the board's lean, turn and roll against upright and facing the car.
    """
    camera = rig.cameras["camera_left"]
    baseline = float(np.linalg.norm(rig.rig_from["camera_right"][:3, 3] - rig.rig_from["camera_left"][:3, 3]))
    far = min(FAR_M, camera.fx * board.SQUARE_M / resolvable_px(camera))
    for _ in range(_TRIES):
        depth = rng.uniform(NEAR_M, far)
        # Where the plate's middle may be for it to fit into both images, more or less.
        half_size = 0.4 * camera.fx / depth * np.array(board.SIZE_M)
        lowest = half_size + np.array([camera.fx * baseline / depth, 0.0])
        pixel = rng.uniform(lowest, np.maximum((camera.width, camera.height) - half_size, lowest))
        centre = apply(rig.rig_from["camera_left"], depth * camera.rays(pixel))
        half = 0.5 * np.radians(np.clip(rng.normal(0, tilt_deg, 3), -40, 40))
        rotation = matrix_from_quaternion(np.concatenate([[1.0], half])) @ _UPRIGHT
        pose = transform(centre, quaternion_from_matrix(rotation))
        pose[:3, 3] -= rotation @ [*(np.add(board.PLATE_CORNER_M, np.divide(board.SIZE_M, 2))), 0.0]
        if _is_visible(rig, ego, pose):
            return pose
    raise CardError("no place for the board before the cameras", found=f"{_TRIES} tries")


def plate_points(rig_from_board: Array, count: int = 9) -> Array:
    """A grid (count * count, 3) over the whole plate, in the rig."""
    x, y = np.meshgrid(*(np.linspace(0, side, count) for side in board.SIZE_M))
    plane = np.stack([x + board.PLATE_CORNER_M[0], y + board.PLATE_CORNER_M[1], 0 * x], axis=-1)
    return apply(rig_from_board, plane.reshape(-1, 3))


def board_quads(rig_from_board: Array) -> list[Quad]:
    """The board and the post that holds it, far to near."""
    plate = rig_from_board @ transform([*board.PLATE_CORNER_M, 0.0])
    low_edge = plate_points(rig_from_board).reshape(9, 9, 3)[-1, 4]
    foot = np.array([low_edge[0] - 0.03, low_edge[1], _GROUND_Z_M])
    post = _facing(foot, (0.06, float(low_edge[2] - _GROUND_Z_M)), _flat((70, 60, 55)), 40)
    return [post, Quad(plate, board.SIZE_M, board.texture(), 90)]


def surroundings(rng: np.random.Generator) -> list[Quad]:
    """Ground, a wall, and clutter before it, far to near: different each session."""
    ground = transform([-20.0, -5.0, _GROUND_Z_M])
    wall_y = rng.uniform(9.0, 12.0)
    quads = [
        Quad(ground, (40.0, 30.0), _asphalt(rng), 25),
        _facing(np.array([-15.0, wall_y, _GROUND_Z_M]), (30.0, 4.5), _bricks(rng), 60),
    ]
    for y in np.sort(rng.uniform(6.3, wall_y - 0.3, 7))[::-1]:
        size = (rng.uniform(0.4, 1.6), rng.uniform(0.5, 2.2))
        foot = np.array([rng.uniform(-5.0, 5.0), y, _GROUND_Z_M])
        texture = _flat(rng.integers(40, 200, 3))
        texture[::4] = texture[::4] // 2  # slats
        quads.append(_facing(foot, size, texture, int(rng.integers(20, 120))))
    return quads


def _is_visible(rig: Rig, ego: Masks, pose: Array) -> bool:
    points = plate_points(pose)
    if points[:, 2].min() < _GROUND_Z_M + 0.05 or points[:, 1].max() > FAR_M + 0.2:
        return False
    for name in CAMERAS:
        camera = rig.cameras[name]
        inside = apply(inverse(rig.rig_from[name]), points)
        if inside[:, 2].min() < 0.8 * NEAR_M:
            return False
        corners = camera.project(apply(inverse(rig.rig_from[name]) @ pose, board.corners_m()))
        if _smallest_step(corners) < resolvable_px(camera):
            return False
        pixels = camera.project(inside)
        limit = np.array([camera.width, camera.height]) - 1 - _BORDER_PX
        if (pixels < _BORDER_PX).any() or (pixels > limit).any():
            return False
        columns, rows = np.rint(pixels).astype(int).T
        if ego[name][rows, columns].any():
            return False
    x, y, z = apply(inverse(rig.rig_from["lidar_front"]), points).T
    elevation = np.arctan2(z, np.hypot(x, y))
    top, bottom = lidar_elevations_rad()[[0, -1]]
    return bool(np.mean((elevation < top) & (elevation > bottom)) > 0.25)


def _smallest_step(corners: Array) -> float:
    """Shortest distance between corners that are neighbours, pixels."""
    columns, rows = board.INNER_CORNERS
    lattice = corners.reshape(rows, columns, 2)
    steps = [np.linalg.norm(np.diff(lattice, axis=axis), axis=-1).min() for axis in (0, 1)]
    return float(min(steps))


def _facing(foot: Array, size: tuple[float, float], texture: NDArray[np.uint8], intensity: int) -> Quad:
    """An upright rectangle towards the car whose lower left corner is `foot`."""
    upper_left = foot + np.array([0.0, 0.0, size[1]])
    return Quad(transform(upper_left, quaternion_from_matrix(_UPRIGHT)), size, texture, intensity)


def _flat(colour: object) -> NDArray[np.uint8]:
    return np.broadcast_to(np.asarray(colour, dtype=np.uint8), (32, 32, 3)).copy()


def _asphalt(rng: np.random.Generator) -> NDArray[np.uint8]:
    grain = rng.normal(92, 9, (900, 1200, 1)) + np.array([2.0, 0.0, -2.0])
    grain[:, 300:306] = grain[:, 890:896] = 200  # painted lines
    return np.clip(grain, 0, 255).astype(np.uint8)


def _bricks(rng: np.random.Generator) -> NDArray[np.uint8]:
    rows, columns = 270, 1800
    y, x = np.mgrid[0:rows, 0:columns]
    course = y // 9
    shifted = x + (course % 2) * 9
    tone = rng.uniform(0.8, 1.15, (31, 102))[course, shifted // 18]
    joint = (y % 9 == 0) | (shifted % 18 == 0)
    colour = np.where(joint[..., None], 165.0, tone[..., None] * np.array([150.0, 92.0, 76.0]))
    return np.clip(colour, 0, 255).astype(np.uint8)
