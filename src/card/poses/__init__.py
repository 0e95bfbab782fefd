"""Poses of a sequence: from a delivered trajectory."""

from card.poses.import_trajectory import import_trajectory

__all__ = ["import_trajectory"]
