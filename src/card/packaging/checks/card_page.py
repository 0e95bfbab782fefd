"""The YAML of the dataset card names the licence, and configs whose files exist."""

from collections.abc import Iterator

import yaml

from card.packaging.checks.contents import Contents
from card.packaging.pages import front_matter


def check_card_page(contents: Contents) -> Iterator[str]:
    """README.md opens with exactly the YAML that the release calls for."""
    path = contents.tree / "README.md"
    if contents.release is None or not path.is_file():
        return
    parts = path.read_text(encoding="utf-8", errors="replace").split("---\n", 2)
    if len(parts) != 3 or parts[0]:
        yield "README.md: does not open with YAML between two lines of ---"
        return
    try:
        found = yaml.safe_load(parts[1])
    except yaml.YAMLError as error:
        yield f"README.md: YAML is broken ({' '.join(str(error).split())})"
        return
    if not isinstance(found, dict):
        yield "README.md: YAML is not a mapping"
        return
    wanted = front_matter(contents.release, found.get("pretty_name", ""), bool(contents.mini))
    for name, value in wanted.items():
        if found.get(name) != value:
            yield f"README.md: {name} of the YAML is not as the release calls for"
    for line in parts[2].splitlines():
        if "$" in line:
            yield f"README.md: a placeholder was left in `{line.strip()}`"
