"""Rigid transforms, trajectories, the camera model and stereo rectification."""

from card.geometry.camera import CameraModel
from card.geometry.rasterize import rasterize
from card.geometry.rectify import Rectification, pixel_map, rectify, remap
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
    "Rectification",
    "Trajectory",
    "apply",
    "from_json",
    "inverse",
    "matrix_from_quaternion",
    "pixel_map",
    "quaternion_from_matrix",
    "rasterize",
    "rectify",
    "remap",
    "to_json",
    "transform",
]
