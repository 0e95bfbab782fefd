"""Which repository a sequence is in, where one licence needs several because the Hub limits a repository."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import atomic_file, read_json, read_sheet, read_table
from card.errors import CardError


def read_batches(path: Path) -> dict[str, int]:
    """Batch by sequence of the committed, append-only ledger; a sequence without a row is in the first."""
    batches: dict[str, int] = {}
    for row in read_sheet(path, "batches"):
        if row["sequence"] in batches:
            raise CardError("sequence is in two batches", where=path, found=row["sequence"])
        batches[row["sequence"]] = int(row["batch"])
    return batches


def batch_repository(base: str, batch: int) -> str:
    """Name of the repository of a batch: the first has the licence's own."""
    return base if batch == 1 else f"{base}-batch{batch}"


def choose_batches(
    known: Mapping[str, int], sequences: Sequence[Mapping[str, Any]], limits: Mapping[str, Any]
) -> list[tuple[str, int]]:
    """(sequence, batch) of the sequences that do not fit into the first batch and have none yet.

    Parameters
    ----------
    known : batches so far, which stay. sequences : {id, repository, files, bytes} in the order of the sheet,
        `repository` that of the licence. limits : settings `packaging.hub`.

    Each goes into the first batch of its licence with room. CardError for one that fits into none.
    """
    used: dict[tuple[str, int], list[int]] = {}
    rows = []
    for item in sorted(sequences, key=lambda item: item["id"] not in known):
        size = (item["files"], item["bytes"])
        if item["files"] > _files(limits) or item["bytes"] > limits["max_bytes"]:
            raise CardError(
                "sequence larger than a repository", where=item["id"], found=f"{item['bytes']} bytes"
            )
        batch = known.get(item["id"], 0)
        while batch == 0 or (
            item["id"] not in known and not _fits(used.get((item["repository"], batch)), size, limits)
        ):
            batch += 1
        totals = used.setdefault((item["repository"], batch), [0, 0])
        totals[0] += size[0]
        totals[1] += size[1]
        if item["id"] not in known and batch > 1:
            rows.append((item["id"], batch))
    return rows


def append_batches(path: Path, rows: Sequence[tuple[str, int]]) -> None:
    """Add rows at the end of the ledger; what stands in it keeps its bytes."""
    old = path.read_text(encoding="utf-8")
    with atomic_file(path) as partial:
        partial.write_text(
            old + "".join(f"{sequence}\t{batch}\n" for sequence, batch in rows), encoding="utf-8"
        )


def _fits(totals: Sequence[int] | None, size: tuple[int, int], limits: Mapping[str, Any]) -> bool:
    files, used = totals or (0, 0)
    return files + size[0] <= _files(limits) and used + size[1] <= limits["max_bytes"]


def _files(limits: Mapping[str, Any]) -> int:
    # Room for the pages, tables and schemas of the tree.
    return int(limits["max_files"]) - 100


def extend_batches(path: Path, packages: Sequence[Mapping[str, Any]], limits: Mapping[str, Any]) -> None:
    """Append what `choose_batches` says of {repository, package} each, in the order of the sheet."""
    sequences = []
    for item in packages:
        package = Path(item["package"])
        listed = read_table(package / "inventory.parquet", "inventory").to_pydict()
        sizes = [
            size
            for name, size in zip(listed["name"], listed["size"], strict=True)
            if name.startswith(("data/", "sidecars/"))
        ]
        name = read_json(package / "sequence.json", "release_sequence")["sequence"]
        sequences.append(
            {"id": name, "repository": item["repository"], "files": len(sizes), "bytes": sum(sizes)}
        )
    if rows := choose_batches(read_batches(path), sequences, limits):
        append_batches(path, rows)
