"""What must hold before anything is sent."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts import read_json, sha256_file
from card.errors import CardError
from card.packaging.pages import front_matter_of
from card.packaging.reader.verify import SUMS, verify

STATED = ("creator", "contact", "url", "authors")
PLACEHOLDERS = ("placeholder", "example.org", "example.com", "todo")


def check_ready(tree: Path, about: Mapping[str, Any], hub: Mapping[str, Any]) -> None:
    """CardError for a tree that was not validated or has changed since, and for placeholders.

    Parameters
    ----------
    about : settings `packaging.release`; creator, contact, url and authors must be real.
    hub : settings `packaging.hub`; a gated repository must have its text, in the tree too.
    """
    stated = {f"packaging.release.{name}": about[name] for name in STATED}
    stated["packaging.hub.namespace"] = hub["namespace"]
    if hub["gated"] != "none":
        stated["packaging.hub.gate_text"] = hub["gate_text"]
    for name, value in stated.items():
        for text in [value] if isinstance(value, str) else value or [""]:
            if not text.strip() or any(word in text.lower() for word in PLACEHOLDERS):
                raise CardError(
                    "placeholder", where=name, found=text or "nothing", wanted="what the world is to read"
                )
    report = tree.with_name(f"{tree.name}.validation.json")
    if not (tree / SUMS).is_file() or not report.is_file():
        raise CardError("release was not validated", where=tree, wanted="`snakemake validate`")
    if read_json(report, "report")["inputs"].get("checksums") != sha256_file(tree / SUMS):
        raise CardError(
            "release has changed since it was validated", where=tree, wanted="`snakemake validate`"
        )
    if findings := verify(tree, tree.with_name(f".{tree.name}.verified")):
        raise CardError(f"release has changed since it was validated: {findings[0]}", where=tree)
    found = read_json(tree / "release.json", "release")["version"]
    if found != about["version"]:
        raise CardError("release is of another version", where=tree, found=found, wanted=about["version"])
    page = front_matter_of(tree / "README.md")
    text = hub["gate_text"] if hub["gated"] != "none" else None
    if page.get("extra_gated_prompt") != text:
        raise CardError(
            "release states another gate", where=tree, wanted="`snakemake release` with the gate's text"
        )
