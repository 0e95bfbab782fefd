"""Validate the release tree of one licence."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.validate import validate

with logged(Path(snakemake.log[0])):
    validate(
        Path(snakemake.params.tree),
        report=Path(snakemake.output.validation),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        ledger=snakemake.params.ledger,
    )
