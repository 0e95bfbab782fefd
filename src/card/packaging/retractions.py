"""The table of retractions of a tree: tombstones of this and all earlier versions."""

from collections.abc import Mapping, Sequence
from typing import Any

from card.errors import CardError

KEY = ("sequence", "modality", "frame", "burst")


def retraction_rows(
    stones: Sequence[Mapping[str, Any]], previous: Sequence[Mapping[str, Any]], version: str
) -> list[dict[str, Any]]:
    """Rows of `retractions`: `stones` with the version that was the first without.

    previous : rows of the last release, whose versions stand. CardError for a tombstone there that is gone:
    what was taken down stays down.
    """
    known = {_key(row): row for row in previous}
    rows = []
    for stone in stones:
        old = known.pop(_key(stone), None)
        # A region that became a whole frame is retracted anew.
        stands = old is not None and old["region"] == stone["region"]
        rows.append({**stone, "version": old["version"] if old is not None and stands else version})
    whole = {stone["sequence"] for stone in stones if stone["modality"] is None}
    for row in known.values():
        if row["sequence"] not in whole:
            raise CardError(
                "a takedown of an earlier release is missing",
                where="config/takedowns.yaml",
                found=f"nothing about {row['sequence']}, {row['modality']}, "
                f"{row['frame'] if row['burst'] is None else row['burst']}",
                wanted="every earlier entry",
            )
    return sorted(rows, key=lambda row: tuple(str(row[name]).zfill(8) for name in KEY))


def remains(
    rows: Sequence[Mapping[str, Any]], members: Sequence[Mapping[str, Any]], sequences: Sequence[str]
) -> list[str]:
    """Names of retracted files and sequences that are there all the same."""
    gone = {_key(row) for row in rows if not row["region"]}
    found = [member["file"] for member in members if _key(member) in gone]
    return found + [
        row["sequence"] for row in rows if row["modality"] is None and row["sequence"] in sequences
    ]


def _key(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(row[name] for name in KEY)
