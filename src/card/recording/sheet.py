"""The sequence sheet: which recordings are released, and as what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from card.artifacts.documents import read_sheet
from card.errors import CardError
from card.recording.paths import SENSORS


@dataclass(frozen=True)
class Sequence:
    """One row of the sheet, as schema ``sequences`` describes it.

    session, quarantine: empty where the sheet says ``-``.
    modalities: the sensors the recording has, in the order of `card.recording.paths.SENSORS`.
    """

    id: str
    recording: str
    format: str
    country: str
    place: str
    session: str
    road_type: str
    light: str
    role: str
    off_road: bool
    modalities: tuple[str, ...]
    quarantine: str

    def as_dict(self) -> dict[str, Any]:
        """The row in builtins, modalities as a list."""
        return asdict(self) | {"modalities": list(self.modalities)}


def read_sequences(path: Path, countries: Mapping[str, Any]) -> list[Sequence]:
    """Read the sheet at `path`, in its order.

    countries: the countries that have a licence (``config/licenses.yaml``).

    Raises CardError naming file and sequence for a row that does not fit the schema, an id or a
    recording given twice, or a country without a licence.
    """
    sequences = [_sequence(row) for row in read_sheet(path, "sequences")]
    for index, sequence in enumerate(sequences):
        before = sequences[:index]
        if any(other.id == sequence.id for other in before):
            raise CardError("duplicate id", where=path, found=sequence.id, wanted="each id once")
        if any(other.recording == sequence.recording for other in before):
            raise CardError(
                "recording used twice",
                where=f"{path}, {sequence.id}",
                found=sequence.recording,
                wanted="one sequence a recording",
            )
        if sequence.country not in countries:
            raise CardError(
                "country without a licence",
                where=f"{path}, {sequence.id}",
                found=sequence.country,
                wanted=f"one of {', '.join(sorted(countries))}, or a new entry in licenses.yaml",
            )
    return sequences


def _sequence(row: Mapping[str, str]) -> Sequence:
    cells = dict(row) | {name: "" for name in ("session", "quarantine") if row[name] == "-"}
    named = set(cells["modalities"].split(","))
    modalities = SENSORS if named == {"all"} else tuple(name for name in SENSORS if name in named)
    return Sequence(**cells | {"off_road": cells["off_road"] == "true", "modalities": modalities})  # type: ignore[arg-type]
