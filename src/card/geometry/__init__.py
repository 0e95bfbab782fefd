"""Rigid transforms, trajectories, the road plane, the camera model and stereo rectification."""

from card.geometry.camera import CameraModel
from card.geometry.rasterize import rasterize
from card.geometry.rectify import Rectification, pixel_map, rectify, remap
from card.geometry.roads import Roads, height_above_road, points_above_road
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
    "Roads",
    "Trajectory",
    "apply",
    "from_json",
    "height_above_road",
    "inverse",
    "matrix_from_quaternion",
    "pixel_map",
    "points_above_road",
    "quaternion_from_matrix",
    "rasterize",
    "rectify",
    "remap",
    "to_json",
    "transform",
]
