"""`card upload`: show what an upload would do, or do it."""

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("upload", help="plan the upload of a release, or send it")
    parser.add_argument("tree", type=Path)
    parser.add_argument("--config", type=Path, default=Path("config/config.yaml"))
    parser.add_argument("--send", action="store_true", help="send; without it only the plan is shown")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Check the tree, print the plan, and send if told to."""
    from card.artifacts import load_schema, read_yaml
    from card.artifacts.schemas import with_defaults
    from card.packaging.upload import upload

    settings = with_defaults(read_yaml(options.config, "config"), load_schema("config"))
    for line in upload(options.tree, Path(settings["records"]), settings["packaging"], options.send):
        print(line)
