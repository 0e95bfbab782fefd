"""Append rows for new sequences to the committed splits ledger."""

from pathlib import Path

from card.artifacts import logged
from card.splits.extend import extend_ledger

with logged(Path(snakemake.log[0])):
    extend_ledger(
        sequences=snakemake.params.sequences,
        results=Path("results"),
        ledger=Path(snakemake.params.ledger),
        anchors=Path(snakemake.input.anchors),
        settings=snakemake.params.cfg["settings"],
    )
