"""The local road plane under the car."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RoadPlanes:
    """Planes of F frames, in rig: a point p is normal . p + offset above its plane.

    normal : (F, 3) unit, upward. offset_m : (F,) height of the rig's origin over the road.
    residual_m : (F,) root mean square distance of the four contacts from the plane along z.
    """

    normal: Array
    offset_m: Array
    residual_m: Array

    def road_from_rig(self) -> Array:
        """Transforms (F, 4, 4): the road frame has its origin under the rig's, Z along the normal and Y
        along the rig's forward axis laid on the plane."""
        forward = np.array([0.0, 1.0, 0.0]) - self.normal * self.normal[:, 1:2]
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        matrix = np.zeros((len(self.normal), 4, 4))
        matrix[:, 0, :3] = np.cross(forward, self.normal)
        matrix[:, 1, :3] = forward
        matrix[:, 2, :3] = self.normal
        matrix[:, 2, 3] = self.offset_m
        matrix[:, 3, 3] = 1.0
        return matrix


def fit_road_planes(contacts_rig: Array) -> RoadPlanes:
    """Least-squares planes z = a x + b y + c through the contacts (F, 4, 3), metres in rig.

    Paper, supplement, "Height Evaluation Metrics". Four contacts have one equation too many: what is left
    is the residual.
    """
    ones = np.ones((*contacts_rig.shape[:-1], 1))
    design = np.concatenate([contacts_rig[..., :2], ones], axis=-1)
    z = contacts_rig[..., 2:]
    slopes = np.linalg.pinv(design) @ z
    residual = (design @ slopes - z)[..., 0]
    a, b, c = slopes[..., 0].T
    length = np.sqrt(a * a + b * b + 1)
    normal = np.stack([-a, -b, np.ones_like(a)], axis=-1) / length[:, None]
    return RoadPlanes(normal, -c / length, np.sqrt(np.mean(residual**2, axis=1)))
