"""Wheel excitation and the road under the car."""

from card.wheels.excitation import excite
from card.wheels.road_plane import height_above_road

__all__ = ["excite", "height_above_road"]
