"""Read a release tree, downloaded or on the Hub: any file by its offset, no unpacking."""

from card.packaging.reader.frame import Frame
from card.packaging.reader.release import SPLITS, Release

__all__ = ["SPLITS", "Frame", "Release"]
