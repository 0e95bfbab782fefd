"""`card diff`: what changed between two releases, as JSON."""

import argparse
import json
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "diff", help="what changed between two releases, and the version it calls for"
    )
    parser.add_argument("old", type=Path, help="tree or record of the older one")
    parser.add_argument("new", type=Path, help="tree or record of the newer one")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the document `changes`."""
    from card.packaging.versions import changes, read_records

    print(json.dumps(changes(read_records(options.old), read_records(options.new)), indent=1, sort_keys=True))
