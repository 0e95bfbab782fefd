"""Typed reading and writing of every artifact: checked, atomic and deterministic."""

from card.artifacts.atomic import atomic_file, atomic_folder
from card.artifacts.documents import read_json, read_sheet, read_yaml, write_json
from card.artifacts.hashing import inventory, sha256_file
from card.artifacts.logs import logged, progress
from card.artifacts.reports import Figure, write_report
from card.artifacts.schemas import check, default_settings, load_schema
from card.artifacts.tables import read_arrays, read_table, write_arrays, write_table

__all__ = [
    "Figure",
    "atomic_file",
    "atomic_folder",
    "check",
    "default_settings",
    "inventory",
    "load_schema",
    "logged",
    "progress",
    "read_arrays",
    "read_json",
    "read_sheet",
    "read_table",
    "read_yaml",
    "sha256_file",
    "write_arrays",
    "write_json",
    "write_report",
    "write_table",
]
