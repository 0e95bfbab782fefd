"""`card verify`: check a download against its checksums."""

import argparse
from pathlib import Path
from typing import Any

from card.errors import CardError


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("verify", help="check a download against its checksums")
    parser.add_argument("tree", type=Path)
    parser.add_argument("--partial", action="store_true", help="only some files were downloaded")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print what is bad, one line a part; CardError with their number."""
    from card.packaging.reader.verify import verify

    tree: Path = options.tree.resolve()
    done = tree.with_name(f".{tree.name}.verified")
    findings = verify(tree, done, partial=options.partial)
    for line in findings:
        print(line)
    if findings:
        raise CardError("the copy is not good", where=options.tree, found=f"{len(findings)} bad parts")
    print(f"{options.tree} is good")
