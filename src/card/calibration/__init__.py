"""Calibration of a sequence: from the raw sessions of its day, or from a delivered bundle."""

from card.calibration.import_bundle import import_bundle

__all__ = ["import_bundle"]
