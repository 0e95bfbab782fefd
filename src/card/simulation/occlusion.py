"""How much of what a label shows is hidden: its silhouette in an image against its pixels in sight."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from card.geometry import CameraModel, apply, inverse
from card.simulation.labels import CLASSES, Box
from card.simulation.mesh import Mesh
from card.simulation.world import World

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Shape:
    """Corners of a thing's triangles (T, 3, 3), and the mover that carries it, None for what stands."""

    corners: Array
    mover: int | None


class Silhouettes:
    """The silhouettes of all things of a world that carry labels."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._shapes: dict[int, _Shape] = {}
        self._collect(world.static, None)
        for number, mover in enumerate(world.movers):
            self._collect(mover.mesh, number)

    def share(self, box: Box, camera: str, t_ns: int) -> float:
        """Share 0 to 1 of what a box shows that is in sight, of what of it lies within the image."""
        shape, world = self._shapes[box.thing], self._world
        camera_from_body = inverse(world.path.at(t_ns) @ world.rig.rig_from[camera])
        if shape.mover is not None:
            camera_from_body = camera_from_body @ world.movers[shape.mover].path.at(t_ns)
        corners = apply(camera_from_body, shape.corners.reshape(-1, 3)).reshape(-1, 3, 3)
        # The lens model folds back far outside the image: keep to what is in front and near the view.
        near = (corners[..., 2] > 0.3) & (np.abs(corners[..., 0]) < 1.2 * corners[..., 2])
        corners = corners[near.all(axis=1)]
        area = _area(world.rig.cameras[camera], corners, flat=box.kind not in CLASSES)
        return min(1.0, box.visible / area) if area else 1.0

    def _collect(self, mesh: Mesh, mover: int | None) -> None:
        chosen = np.flatnonzero(mesh.thing >= 0)
        chosen = chosen[np.argsort(mesh.thing[chosen], kind="stable")]
        things, first = np.unique(mesh.thing[chosen], return_index=True)
        for thing, triangles in zip(things.tolist(), np.split(chosen, first)[1:], strict=True):
            self._shapes[thing] = _Shape(mesh.vertices[mesh.triangles[triangles]], mover)


def with_shares(world: World, shown: Iterable[tuple[str, int, Box]]) -> list[tuple[str, int, Box]]:
    """Boxes of cameras at times (ns), each with the share of it that is in sight."""
    silhouettes = Silhouettes(world)
    return [(name, t, replace(box, share=silhouettes.share(box, name, t))) for name, t, box in shown]


def _area(model: CameraModel, corners: Array, *, flat: bool) -> float:
    """Pixels that triangles (T, 3, 3) before a camera cover together in its image.

    That is at most their convex hull and, unless they are ``flat`` and few, the sum of those seen from their
    front: the one holds for a hole, which hides some of itself, the other for a hump.
    """
    if not len(corners):
        return 0.0
    pixels = model.project(corners.reshape(-1, 3)).reshape(-1, 3, 2)
    low, high = (-0.5, -0.5), (model.width - 0.5, model.height - 0.5)
    frame = np.array([low, (high[0], low[1]), high, (low[0], high[1])], np.float32)
    hull = float(
        cv2.intersectConvexConvex(cv2.convexHull(pixels.reshape(-1, 2).astype(np.float32)), frame)[0]
    )
    if flat:
        return hull
    first, second = pixels[:, 1] - pixels[:, 0], pixels[:, 2] - pixels[:, 0]
    signed = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    middle = pixels.mean(axis=1)
    inside = ((middle >= low) & (middle <= high)).all(axis=1)
    # A road's triangles all turn the same way; what faces the camera is the greater part.
    front = signed[inside]
    return min(hull, max(float(front[front > 0].sum()), -float(front[front < 0].sum())))
