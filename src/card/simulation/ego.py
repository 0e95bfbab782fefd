"""Where a camera sees its own car."""

import numpy as np
from numpy.typing import NDArray

from card.artifacts.open3d import import_open3d
from card.geometry import CameraModel
from card.simulation.bodies import ego_body


def ego_pixels(camera: CameraModel, rig_from_camera: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels (height, width) whose centre ray meets the car's own body."""
    o3d = import_open3d()
    body = ego_body()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(body.vertices.astype(np.float32), body.triangles.astype(np.uint32))
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    directions = camera.rays(np.stack([u, v], axis=-1)) @ rig_from_camera[:3, :3].T
    origins = np.broadcast_to(rig_from_camera[:3, 3], directions.shape)
    rays = np.concatenate([origins, directions], axis=-1).astype(np.float32)
    return np.asarray(scene.test_occlusions(o3d.core.Tensor(rays)).numpy(), dtype=np.bool_)
