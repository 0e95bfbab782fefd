"""`croissant.json` describes this tree: by its own validator, and what that does not look at."""

import logging
from collections.abc import Iterator

from card.packaging.checks.contents import Contents
from card.packaging.croissant import TABLES, record_set


def check_croissant(contents: Contents) -> Iterator[str]:
    """Name, version and licence are the release's, every table and shard is there with its columns."""
    document, release = contents.croissant, contents.release
    if document is None or release is None:
        return
    for name, wanted in (("name", release["repository"]), ("version", release["version"]),
                         ("datePublished", release["date"])):  # fmt: skip
        if document[name] != wanted:
            yield f"croissant.json: {name} is {document[name]}, the release's {wanted}"
    listed = {file["@id"] for file in document["distribution"]}
    shards = {row["shard"] for row in contents.members}
    for path in sorted((shards | set(TABLES)) - listed):
        yield f"croissant.json: {path} is not in its distribution"
    records = {record["@id"]: record for record in document["recordSet"]}
    for path, schema in TABLES.items():
        wanted = record_set(path, schema)
        if records.get(wanted["@id"]) != wanted:
            yield f"croissant.json: recordSet {wanted['@id']} is not that of {path}"


def check_croissant_format(contents: Contents) -> Iterator[str]:
    """What the format's own validator, which is slow, has to say."""
    try:
        import mlcroissant
    except ImportError:  # a light install checks what it can
        return
    logging.getLogger("absl").setLevel(logging.ERROR)
    try:
        issues = mlcroissant.Dataset(jsonld=contents.tree / "croissant.json").metadata.ctx.issues
    except Exception as error:  # whatever the validator stumbles over
        yield f"croissant.json: mlcroissant cannot read it ({' '.join(str(error).split())[:200]})"
        return
    for issue in sorted(issues.errors):
        yield f"croissant.json: {' '.join(str(issue).split())[:200]}"
