"""Every file is listed with its hash, and every listed file is there."""

import re
from collections.abc import Iterator

from card.artifacts import sha256_file
from card.packaging.checks.contents import Contents
from card.packaging.reader import SPLITS

REQUIRED = (
    "README.md", "LICENSE", "NOTICE", "CITATION.cff", "CHANGELOG.md", "CONVENTIONS.md", "TAKEDOWN.md",
    "croissant.json", "release.json", "changes.json", "SHA256SUMS", "metadata/sequences.parquet",
    "metadata/members.parquet", "metadata/files.parquet", "metadata/retractions.parquet", "mini/mini.parquet",
    *(f"metadata/frames-{split}.parquet" for split in SPLITS),
)  # fmt: skip
LINE = re.compile(r"([0-9a-f]{64})  (\S.*)")


def check_files(contents: Contents) -> Iterator[str]:
    """Required files, checksums both ways, shards and sequence folders that nothing refers to."""
    tree = contents.tree
    for path in REQUIRED:
        if not (tree / path).is_file():
            yield f"{path}: missing"
    present = {path.relative_to(tree).as_posix() for path in tree.rglob("*") if not path.is_dir()}
    listed: dict[str, str] = {}
    sums = tree / "SHA256SUMS"
    if sums.is_file():
        for number, line in enumerate(
            sums.read_text(encoding="utf-8", errors="replace").splitlines(), start=1
        ):
            match = LINE.fullmatch(line)
            if match is None:
                yield f"SHA256SUMS:{number}: not a checksum line"
            elif match[2] in listed:
                yield f"SHA256SUMS:{number}: {match[2]} is listed twice"
            else:
                listed[match[2]] = match[1]
        for path in sorted(present - set(listed) - {"SHA256SUMS"}):
            yield f"{path}: not in SHA256SUMS"
    for path, sha256 in sorted(listed.items()):
        if path not in present:
            yield f"{path}: in SHA256SUMS but not in the tree"
        elif (found := sha256_file(tree / path)) != sha256:
            yield f"{path}: checksum differs (found {found[:12]}, wanted {sha256[:12]})"

    shards = {row["shard"] for row in contents.members}
    for path in sorted(present):
        if path.startswith("data/") and path not in shards:
            yield f"{path}: no member lies in it"
        if path.startswith("sequences/") and path.split("/")[1] not in contents.sidecars:
            yield f"{path}: sidecar of a sequence that metadata/sequences.parquet lacks"
    for file in (contents.croissant or {}).get("distribution", ()):
        if listed.get(file["@id"]) != file["sha256"]:
            yield f"croissant.json: sha256 of {file['@id']} is not that of SHA256SUMS"
