"""A tree keeps within what the Hub takes in one repository."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from card.packaging.checks.contents import Contents

REMEDY = "give sequences another batch: `snakemake assign_batches`"


def check_limits(contents: Contents, limits: Mapping[str, Any]) -> Iterator[str]:
    """Files, bytes, entries of a folder and size of a shard; `limits` are the settings `packaging.hub`."""
    files = [path for path in contents.tree.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files)
    if len(files) > limits["max_files"]:
        yield f"release: {len(files)} files, the Hub takes {limits['max_files']}; {REMEDY}"
    if size > limits["max_bytes"]:
        yield f"release: {size} bytes, a repository may hold {limits['max_bytes']}; {REMEDY}"
    entries = Counter(path.parent for path in contents.tree.rglob("*"))
    for folder, count in sorted(entries.items()):
        if count > limits["max_folder_entries"]:
            where = folder.relative_to(contents.tree).as_posix()
            yield f"{where}: {count} entries, the Hub takes {limits['max_folder_entries']}; {REMEDY}"
    for path in sorted(files):
        if path.stat().st_size > limits["max_file_bytes"]:
            where = path.relative_to(contents.tree).as_posix()
            yield f"{where}: larger than {limits['max_file_bytes']} bytes; lower packaging.shard_max_bytes"
