"""Where a camera sees its own car."""

import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel
from card.simulation.bodies import ego_body
from card.simulation.lens import lens_of
from card.simulation.raycast import Scene


def ego_pixels(camera: CameraModel, rig_from_camera: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels (height, width) whose centre ray meets the car's own body."""
    lens, body = lens_of(camera), Scene(ego_body())
    seen = np.empty(lens.length.shape, np.bool_)
    for rows in lens.bands():
        x, y = lens.rays[rows, :, :1], lens.rays[rows, :, 1:]
        turn = rig_from_camera[:3, :3]
        rays = (x * turn[:, 0] + y * turn[:, 1] + turn[:, 2]) / lens.length[rows][..., None]
        hits = body.cast(rig_from_camera[:3, 3], rays.reshape(-1, 3))
        seen[rows] = (hits.triangle >= 0).reshape(rays.shape[:2])
    return seen
