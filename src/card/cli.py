"""Command line: `card validate TREE`, `card summary`, and those of COMMANDS."""

import argparse
import logging
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from card.errors import CardError

COMMANDS = (
    "card.packaging.commands.verify",
    "card.packaging.commands.extract",
    "card.packaging.commands.upload",
    "card.packaging.commands.takedown",
    "card.packaging.commands.diff",
    "card.packaging.commands.firewall",
    "card.splits.command",
    "card.benchmark.command",
    "card.simulation.command",
    "card.annotations.command",
)
"""Modules with `add`, which adds a command to the parser."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 1 and a line on standard error when it cannot be done."""
    parser = argparse.ArgumentParser(prog="card", description="Release pipeline for road-topography drives.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    validate = commands.add_parser("validate", help="check a release tree")
    validate.add_argument("tree", type=Path)
    validate.add_argument("--ledger", type=Path, help="split ledger that the splits must equal")
    validate.add_argument("--load", action="store_true", help="also load every config with `datasets`")
    validate.set_defaults(run=_validate)

    summary = commands.add_parser("summary", help="what was released")
    summary.add_argument("release", type=Path, nargs="?", default=Path("results/release"))
    summary.set_defaults(run=_summary)

    for module in COMMANDS:
        import_module(module).add(commands)

    options = parser.parse_args(arguments)
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    try:
        options.run(options)
    except (CardError, OSError) as error:
        print(f"card: {error}", file=sys.stderr)
        return 1
    return 0


def _validate(options: argparse.Namespace) -> None:
    from card.artifacts import default_settings, read_sheet
    from card.packaging.validate import validate

    settings = default_settings("packaging") | {"load_dataset": options.load}
    ledger = read_sheet(options.ledger, "splits_ledger") if options.ledger else None
    validate(options.tree, report=None, settings=settings, ledger=ledger)
    print(f"{options.tree} is valid")


def _summary(options: argparse.Namespace) -> None:
    from card.packaging.summary import summarize

    print(summarize(options.release))
