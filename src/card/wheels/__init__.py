"""Wheel excitation and the road under the car."""

from card.wheels.excitation import excite

__all__ = ["excite"]
