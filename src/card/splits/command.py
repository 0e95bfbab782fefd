"""`card splits`: extend and check the split ledger."""

import argparse
from pathlib import Path
from typing import Any

from card.errors import CardError


def add(commands: Any) -> None:
    """Add the command to the parser."""
    actions = commands.add_parser("splits", help="the split ledger").add_subparsers(
        required=True, metavar="ACTION"
    )
    extend = actions.add_parser("extend", help="append rows for new sequences")
    extend.add_argument("--config", type=Path, default=Path("config/config.yaml"))
    extend.add_argument("--results", type=Path, default=Path("results"))
    extend.set_defaults(run=_extend)
    check = actions.add_parser("check", help="see that no row moved since a git revision")
    check.add_argument("--config", type=Path, default=Path("config/config.yaml"))
    check.add_argument("--against", default="HEAD", help="revision, such as the tag of the last release")
    check.set_defaults(run=_check)


def _settings(config: Path) -> dict[str, Any]:
    from card.artifacts import load_schema, read_yaml
    from card.artifacts.schemas import with_defaults

    return with_defaults(read_yaml(config, "config"), load_schema("config"))


def _extend(options: argparse.Namespace) -> None:
    from card.artifacts import read_yaml
    from card.recording.sheet import read_sequences
    from card.splits.extend import extend_ledger

    settings = _settings(options.config)
    countries = read_yaml(Path(settings["licenses"]), "licenses")["countries"]
    rows = extend_ledger(
        sequences=[sequence.as_dict() for sequence in read_sequences(Path(settings["sheet"]), countries)],
        results=options.results,
        ledger=Path(settings["splits_ledger"]),
        anchors=Path(settings["anchors"]),
        settings=settings["splits"],
    )
    for row in rows:
        print("\t".join(row.cells()))
    print(f"{len(rows)} rows appended to {settings['splits_ledger']}")


def _check(options: argparse.Namespace) -> None:
    from card.splits.history import check_kept
    from card.splits.ledger import read_ledger

    ledger = Path(_settings(options.config)["splits_ledger"])
    rows = read_ledger(ledger)
    if not check_kept(ledger, options.against):
        raise CardError(
            "nothing to compare with", where=ledger, wanted=f"the file at {options.against} in git"
        )
    print(f"{len(rows)} rows, none moved since {options.against}")
