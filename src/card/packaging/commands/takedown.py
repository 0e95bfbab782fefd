"""`card neighbours`, `card purge`, `card history-steps`: what a takedown asks for beside the release."""

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the commands to the parser."""
    near = commands.add_parser("neighbours", help="list images that may show the same as a frame")
    near.add_argument("tree", help="a release that still has the frame: folder or address")
    near.add_argument("sequence")
    near.add_argument("frame", type=int)
    near.add_argument("--camera", choices=("camera_left", "camera_right"), help="camera of --region")
    near.add_argument("--region", nargs=4, type=int, metavar=("X_MIN", "Y_MIN", "X_MAX", "Y_MAX"))
    near.set_defaults(run=_neighbours)

    purge = commands.add_parser("purge", help="delete from a copy what the current version has retracted")
    purge.add_argument("copy", type=Path, help="an older copy: a tree, or extracted files")
    purge.add_argument("release", help="the current version: folder, address or hf://datasets/<owner>/<name>")
    purge.set_defaults(run=_purge)

    steps = commands.add_parser("history-steps", help="steps that remove a version from the Hub's history")
    steps.add_argument("old", type=Path, help="tree or record of the version to remove")
    steps.add_argument("new", type=Path, help="tree or record of the current version")
    steps.add_argument("repository", help="<owner>/<name> on the Hub")
    steps.set_defaults(run=_steps)


def _neighbours(options: argparse.Namespace) -> None:
    from card.artifacts import default_settings
    from card.packaging.neighbours import neighbours
    from card.packaging.reader import Release

    region = (options.camera or "camera_left", options.region) if options.region else None
    settings = default_settings("packaging")
    found = neighbours(Release(options.tree), options.sequence, options.frame, settings, region)
    print("frame\tcamera\twhy\tshare\tx_min\ty_min\tx_max\ty_max")
    for row in found:
        share = "-" if row["share"] is None else f"{row['share']:.2f}"
        box = row["box"] or ["-"] * 4
        print("\t".join(map(str, (row["frame"], row["camera"], row["why"], share, *box))))


def _purge(options: argparse.Namespace) -> None:
    from card.packaging.purge import purge
    from card.packaging.reader import Release

    gone = purge(options.copy, Release(options.release))
    for name in gone:
        print(name)
    print(f"{len(gone)} files deleted from {options.copy}")


def _steps(options: argparse.Namespace) -> None:
    from card.packaging.history_steps import history_steps
    from card.packaging.versions import read_records

    for line in history_steps(read_records(options.old), read_records(options.new), options.repository):
        print(line)
