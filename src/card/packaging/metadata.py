"""The tables under `metadata/` of a release tree."""

from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import load_schema, read_table, write_table
from card.errors import CardError
from card.packaging.reader import SPLITS
from card.packaging.retractions import remains

SPLIT_COLUMNS = ("split", "group", "stratum", "sampled")


def write_metadata(
    tree: Path,
    sequences: Sequence[Mapping[str, Any]],
    rows: Sequence[Mapping[str, Any]],
    retractions: Sequence[Mapping[str, Any]],
) -> list[dict[str, Any]]:
    """Write all tables under `metadata/`; return the rows of the frame tables.

    Parameters
    ----------
    sequences : packages and splits as of `assemble`; rows : their documents `release_sequence`.
    retractions : rows of that table. CardError where something retracted is in a package all the same.
    """
    import pyarrow as pa

    folder = tree / "metadata"
    write_table(
        folder / "sequences.parquet",
        {name: [row[name] for row in rows] for name in load_schema("release_sequences")["columns"]},
        "release_sequences",
    )
    members = [read_table(Path(item["package"]) / "members.parquet", "release_members") for item in sequences]
    empty: dict[str, list[object]] = {name: [] for name in load_schema("release_members")["columns"]}
    write_table(
        folder / "members.parquet", pa.concat_tables(members) if members else empty, "release_members"
    )
    write_table(
        folder / "retractions.parquet",
        {name: [row[name] for row in retractions] for name in load_schema("retractions")["columns"]},
        "retractions",
    )
    packed = [row for table in members for row in table.to_pylist()]
    if left := remains(retractions, packed, [item["id"] for item in sequences]):
        raise CardError("retracted, but packed all the same", where=tree.name, found=left[0])
    gone = {(row["sequence"], row["frame"]) for row in retractions if not row["region"]}
    frames = [row for item in sequences for row in _frames_with_split(item, gone)]
    for split in SPLITS:
        chosen = [row for row in frames if row["split"] == split]
        columns = {name: [row[name] for row in chosen] for name in load_schema("release_frames")["columns"]}
        write_table(folder / f"frames-{split}.parquet", columns, "release_frames")
    return frames


def _frames_with_split(item: Mapping[str, Any], gone: Container[tuple[str, int]]) -> list[dict[str, Any]]:
    frames: list[dict[str, Any]] = read_table(
        Path(item["package"]) / "frames.parquet", "package_frames"
    ).to_pylist()
    splits = (
        {row["frame"]: row for row in read_table(Path(item["splits"]), "splits").to_pylist()}
        if item["splits"]
        else {}
    )
    kept = {frame for frame in splits if (item["id"], frame) not in gone}
    if kept != {row["frame"] for row in frames}:
        raise CardError(
            "splits and package have different frames",
            where=f"sequence {item['id']}",
            found=f"{len(kept)} splits",
            wanted=f"{len(frames)} frames",
        )
    return [row | {name: splits[row["frame"]][name] for name in SPLIT_COLUMNS} for row in frames]
