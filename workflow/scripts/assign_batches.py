"""Append rows for sequences that do not fit into their repository to the committed ledger of batches."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.batches import extend_batches

with logged(Path(snakemake.log[0])):
    extend_batches(
        Path(snakemake.params.ledger),
        [
            {"repository": repository, "package": Path(inventory).parent}
            for repository, inventory in zip(
                snakemake.params.repositories, snakemake.input.packages, strict=True
            )
        ],
        snakemake.params.cfg["settings"]["hub"],
    )
