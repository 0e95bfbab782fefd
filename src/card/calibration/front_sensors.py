"""Both cameras and the front LiDAR as a session calibrated them, with what is not known of them together."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.state import STEREO, intrinsics_of
from card.geometry import CameraModel, from_json
from card.recording.paths import CAMERAS

Array = NDArray[np.float64]

#: Intrinsics of the left and the right camera, then the pose of the right one in the left one.
CAMERA_PARAMETERS = STEREO.stop


@dataclass(frozen=True)
class FrontSensors:
    """Sensors that are taken as they are.

    intrinsics : (2, 9) fx, fy, cx, cy, k1, k2, p1, p2, k3 of the left and the right camera.
    left_from_right, lidar_from_left : (4, 4).
    covariance : (30, 30) of both intrinsics, the stereo pose and the LiDAR's, which move as in `state.moved`.
    """

    intrinsics: Array
    left_from_right: Array
    lidar_from_left: Array
    covariance: Array

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> "FrontSensors":
        """The sensors of a document of schema ``front_lidar_calibration``."""
        models = [CameraModel.from_json(document["cameras"][name]) for name in CAMERAS]
        return cls(
            np.stack([intrinsics_of(model) for model in models]),
            from_json(document["left_from_right"]),
            from_json(document["lidar_front_from_camera_left"]),
            np.array(document["covariances"]["together"], dtype=np.float64),
        )
