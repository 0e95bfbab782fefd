"""Irregularities: what the ground truth says of each label, and where on the map it is."""

from card.irregularities.link import link_irregularities

__all__ = ["link_irregularities"]
