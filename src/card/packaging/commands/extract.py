"""`card extract`: take single files out of a release's shards."""

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("extract", help="take files out of a release, local or on the Hub")
    parser.add_argument("tree", help="folder, web address or hf://datasets/<owner>/<name>[@<revision>]")
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument("--sequence", action="append", default=[], help="only this one; may be repeated")
    parser.add_argument("--split", help="only frames of this split")
    parser.add_argument("--modality", action="append", default=[], help="only this one; may be repeated")
    parser.add_argument(
        "--frame", action="append", type=int, default=[], help="only this number; may be repeated"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Extract what the options choose and say how much it was."""
    from card.packaging.reader import Release
    from card.packaging.reader.extract import extract

    count = extract(
        Release(options.tree),
        options.out,
        sequences=options.sequence,
        split=options.split,
        modalities=options.modality,
        frames=options.frame,
    )
    print(f"{count} files under {options.out}")
