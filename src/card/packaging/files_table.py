"""`metadata/files.parquet`: licence and origin of every file of a tree."""

from collections.abc import Iterable, Sequence

LATER = ("metadata/files.parquet", "changes.json", "croissant.json", "SHA256SUMS")
"""Files that are written once all others are there."""
KINDS = {
    "data": "recorded",
    "sequences": "derived",
    "metadata": "table",
    "mini": "thumbnail",
    "schemas": "schema",
}


def file_columns(paths: Iterable[str], sequences: Sequence[str], spdx: str) -> dict[str, list[str]]:
    """Columns of `release_files` for the paths and those of `LATER`.

    A shard or sidecar comes from its own sequence, a table, thumbnail or page from all of the tree.
    """
    every = ",".join(sorted(sequences))
    rows = []
    for path in sorted({*paths, *LATER}):
        folder, _, rest = path.partition("/")
        kind = KINDS.get(folder, "page") if rest else "page"
        if kind in ("recorded", "derived"):
            origin = rest.partition("/")[0]
            if "ground_truth" in path:
                kind = "derived"
        else:
            origin = "" if kind == "schema" or path == "LICENSE" else every
        rows.append((path, kind, origin, spdx))
    names = ("path", "kind", "sequences", "spdx")
    return {name: [row[index] for row in rows] for index, name in enumerate(names)}
