"""What was filled in the released images, for users who leave those pixels out."""

from collections.abc import Container
from pathlib import Path
from typing import Any

from card.artifacts import read_table


def redactions_of_kept(path: Path, taken: Container[int]) -> Any:
    """Table `redactions` at `path` without the frames that were taken down (`taken`)."""
    import pyarrow as pa

    table = read_table(path, "redactions")
    return table.filter(pa.array([frame not in taken for frame in table["frame"].to_pylist()], pa.bool_()))
