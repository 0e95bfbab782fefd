"""Ingest: a recording is checked as a whole and its tables are written."""

from card.recording.ingest.stage import ingest

__all__ = ["ingest"]
