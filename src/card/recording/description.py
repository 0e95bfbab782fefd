"""recording.yaml: what a raw drive is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts.atomic import atomic_file
from card.artifacts.documents import read_yaml
from card.artifacts.schemas import check
from card.errors import CardError
from card.recording.paths import description_path
from card.recording.sheet import Sequence


def read_description(root: Path) -> dict[str, Any]:
    """The recording.yaml of the folder `root`, checked against schema ``recording``.

    Raises CardError for a missing folder or description, or one that does not fit.
    """
    if not root.is_dir():
        raise CardError("recording is missing", where=root)
    description: dict[str, Any] = read_yaml(description_path(root), "recording")
    return description


def write_description(root: Path, description: Mapping[str, Any]) -> None:
    """Write recording.yaml into `root`; raises CardError for one that does not fit the schema."""
    import yaml

    path = description_path(root)
    check(dict(description), "recording", path)
    with atomic_file(path) as partial:
        partial.write_text(yaml.safe_dump(dict(description), sort_keys=True), encoding="utf-8")


def check_identity(root: Path, sequence: Sequence) -> None:
    """Raises CardError where the sheet's row and recording.yaml name another drive or country.

    The country decides the licence, so the two must not contradict each other.
    """
    description = read_description(root)
    for field in ("id", "country"):
        if description[field] != getattr(sequence, field):
            raise CardError(
                f"{field} differs from the sheet",
                where=description_path(root),
                found=description[field],
                wanted=getattr(sequence, field),
            )
