"""Write docs/configuration.md from the schemas of the configuration; ``--check`` only compares."""

import json
import sys
from pathlib import Path
from typing import Any

from card.artifacts.schemas import load_schema

PAGE = Path(__file__).with_suffix(".md")


def rows(schema: dict[str, Any], prefix: str) -> list[str]:
    """One table row a setting, objects within objects flattened to dotted names."""
    lines = []
    for name, field in schema["properties"].items():
        if "$ref" in field or "properties" in field:
            continue
        default = json.dumps(field["default"]) if "default" in field else "required"
        lines.append(f"| `{prefix}{name}` | `{default}` | {field['description'].replace('|', '&#124;')} |")
    for name, field in schema["properties"].items():
        if "properties" in field:
            lines += rows(field, f"{prefix}{name}.")
    return lines


def page() -> str:
    """The whole page: general settings, then one section a stage."""
    config = load_schema("config")
    sections = [("General", config, "")]
    sections += [
        (name, load_schema(field["$ref"].removeprefix("card:")), f"{name}.")
        for name, field in config["properties"].items()
        if "$ref" in field
    ]
    text = ["# Configuration", "", config["description"], "Generated from `schemas/` by `make docs`.", ""]
    for title, schema, prefix in sections:
        text += [
            f"## {title}",
            "",
            schema["description"],
            "",
            "| setting | default | meaning |",
            "|---|---|---|",
        ]
        text += [*rows(schema, prefix), ""]
    return "\n".join(text)


if __name__ == "__main__":
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(page(), encoding="utf-8")
    elif not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != page():
        sys.exit(f"{PAGE.name} is out of date: run `make docs`")
