"""Poses of a sequence: estimated from LiDAR and IMU, or from a delivered trajectory."""

from card.poses.import_trajectory import import_trajectory

__all__ = ["import_trajectory"]
