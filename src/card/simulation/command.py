"""Command `card preview DRIVE`: what a simulated drive holds, in words and pictures."""

import argparse
from pathlib import Path
from typing import Any

from card.simulation.scales import SCALES


def add(commands: Any) -> None:
    """Add the command to a parser's subparsers."""
    parser = commands.add_parser("preview", help="what a simulated drive holds, with pictures")
    parser.add_argument("drive", help="e.g. de_town_bumps")
    parser.add_argument("--scale", default="demo", choices=list(SCALES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--at", type=float, help="moment shown, s after the recording's start")
    parser.add_argument("--folder", type=Path, help="for the pictures; by default preview/<drive>")
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    from card.simulation.preview import preview

    folder = options.folder or Path("preview") / options.drive
    held = preview(options.drive, folder=folder, scale=options.scale, seed=options.seed, at_s=options.at)
    print(f"{held}\n  pictures    {folder}/top_view.png, sweep.png, stereo.png")
