"""Rigid transforms, trajectories and the camera model."""

from card.geometry.camera import CameraModel
from card.geometry.rasterize import rasterize
from card.geometry.trajectory import Trajectory
from card.geometry.transforms import (
    apply,
    from_json,
    inverse,
    matrix_from_quaternion,
    quaternion_from_matrix,
    to_json,
    transform,
)

__all__ = [
    "CameraModel",
    "Trajectory",
    "apply",
    "from_json",
    "inverse",
    "matrix_from_quaternion",
    "quaternion_from_matrix",
    "rasterize",
    "to_json",
    "transform",
]
