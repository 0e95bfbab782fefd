"""Rows of a measurement: checked, printed as one aligned table, written as JSON."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import write_json

Row = Mapping[str, Any]
HEAD = ("stage", "figure", "value", "unit", "aim", "")


def publish(rows: Sequence[Row], path: Path) -> None:
    """Print the rows and write them to ``path`` as document `benchmark_rows`; NaN becomes null."""
    ordered = [{**row, "value": _finite(row["value"])} for row in rows]
    ordered.sort(key=lambda row: row["stage"])
    write_json(path, ordered, "benchmark_rows")
    print(table(ordered))
    print(f"\nwritten to {path}")


def table(rows: Sequence[Row]) -> str:
    """Rows as text in aligned columns, with whether each aim is met."""
    lines = [HEAD, *map(_cells, rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(HEAD))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if column in (2, 4) else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def met(row: Row) -> bool | None:
    """Whether the aim is met; None where there is no aim, False where there is no value."""
    if row["aim"] is None:
        return None
    if row["value"] is None:
        return False
    return row["value"] >= row["aim"] if row["better"] == "higher" else row["value"] <= row["aim"]


def _cells(row: Row) -> tuple[str, ...]:
    side = "≥" if row["better"] == "higher" else "≤"
    aim = "" if row["aim"] is None else f"{side} {row['aim']:g}"
    verdict = {None: "", True: "met", False: "MISSED"}[met(row)]
    value = "-" if row["value"] is None else f"{row['value']:.4g}"
    return row["stage"], row["figure"], value, "" if row["unit"] == "1" else row["unit"], aim, verdict


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
