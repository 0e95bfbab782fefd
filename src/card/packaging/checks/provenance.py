"""Licence and origin of every file are stated, and agree with where it lies."""

from collections.abc import Iterator

from card.packaging.checks.contents import Contents
from card.packaging.files_table import file_columns

TABLE = "metadata/files.parquet"


def check_provenance(contents: Contents) -> Iterator[str]:
    """`metadata/files.parquet` has just the files of the tree, and of each what follows from its path."""
    if contents.release is None:
        return
    tree = contents.tree
    present = [path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file()]
    columns = file_columns(present, contents.release["sequences"], contents.release["spdx"])
    wanted = {row[0]: row for row in zip(*columns.values(), strict=True)}
    found = {row["path"]: tuple(row[name] for name in columns) for row in contents.files}
    for path in sorted(wanted.keys() - found.keys()):
        yield f"{TABLE}: {path} has no licence"
    for path in sorted(found.keys() - wanted.keys()):
        yield f"{TABLE}: {path} is not in the tree"
    for path in sorted(wanted.keys() & found.keys()):
        if wanted[path] != found[path]:
            yield f"{TABLE}: {path} is stated as {found[path][1:]}, not {wanted[path][1:]}"
    for sequence, sidecars in sorted(contents.sidecars.items()):
        if stated := sidecars.get("provenance.json"):
            row = next((row for row in contents.sequences if row["sequence"] == sequence), None)
            if stated["sequence"] != sequence or (row and stated["country"] != row["country"]):
                yield f"sequences/{sequence}/provenance.json: is of {stated['sequence']}, {stated['country']}"
