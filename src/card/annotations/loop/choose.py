"""The master list: the frames that show irregularities."""

from collections.abc import Iterable
from pathlib import Path

from card.artifacts import atomic_file, read_sheet, read_table
from card.errors import CardError

SCHEMA = "annotation_frames"


def labelled_frames(results: Path, sequences: Iterable[str]) -> list[tuple[str, int]]:
    """Frames with boxes of the sequences that have been imported, ``results/<id>/label_states.parquet``."""
    found = []
    for sequence in sequences:
        path = results / sequence / "label_states.parquet"
        if path.is_file():
            rows = read_table(path, "label_states").to_pylist()
            found += [(sequence, row["frame"]) for row in rows if row["state"] == "boxes"]
    return found


def write_frames(path: Path, frames: Iterable[tuple[str, int]]) -> None:
    """Write the list, for a person to add to and to take from."""
    lines = [f"{sequence}\t{frame}\n" for sequence, frame in sorted(set(frames))]
    with atomic_file(path) as partial:
        partial.write_text("sequence\tframe\n" + "".join(lines), encoding="utf-8")


def read_frames(path: Path, results: Path) -> list[tuple[str, int]]:
    """The list; CardError for a frame that its sequence does not have."""
    known: dict[str, set[int]] = {}
    frames = []
    for row in read_sheet(path, SCHEMA):
        sequence, frame = row["sequence"], int(row["frame"])
        if sequence not in known:
            table = read_table(results / sequence / "frames.parquet", "frames")
            known[sequence] = set(table["frame"].to_pylist())
        if frame not in known[sequence]:
            raise CardError("unknown frame", where=path, found=f"{sequence} {frame}")
        frames.append((sequence, frame))
    return frames
