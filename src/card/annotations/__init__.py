"""Annotations: strict import of label files into one table."""

from card.annotations.import_labels import import_labels

__all__ = ["import_labels"]
