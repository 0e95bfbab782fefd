"""Columns of a table for a test: what it says, and blanks that fit the schema for all the rest."""

from collections.abc import Mapping, Sequence
from typing import Any

from card.artifacts import load_schema


def columns(schema: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    fields = load_schema(schema)["columns"]
    return {name: [row.get(name, _blank(field)) for row in rows] for name, field in fields.items()}


def _blank(field: Mapping[str, Any]) -> Any:
    if field.get("nullable"):
        return None
    if "enum" in field:
        return field["enum"][0]
    return {"string": "x", "bool": False}.get(field["type"], field.get("minimum", 0))
