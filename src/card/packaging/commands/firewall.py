"""`card firewall`: see that trees of different licences share nothing."""

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("firewall", help="see that trees of different licences share nothing")
    parser.add_argument("trees", type=Path, nargs="+")
    parser.add_argument("--licenses", type=Path, default=Path("config/licenses.yaml"))
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Check the trees and say so."""
    from card.packaging.firewall import check_firewall
    from card.packaging.licenses import read_licenses

    check_firewall(options.trees, read_licenses(options.licenses)["countries"])
    print(f"{len(options.trees)} trees share nothing across licences")
