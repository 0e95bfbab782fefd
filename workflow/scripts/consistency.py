"""Score a detector of the seed on the labels that it did not learn from."""

from pathlib import Path

from card.annotations.consistency.stage import consistency
from card.annotations.loop.sample import Sampled
from card.artifacts import logged

with logged(Path(snakemake.log[0])):
    consistency(
        results=Path(snakemake.params.results),
        sample=Path(snakemake.params.sample),
        rows=[Sampled(**row) for row in snakemake.params.rows],
        way=snakemake.wildcards.way,
        classes=snakemake.params.classes,
        scores=Path(snakemake.output.scores),
        table=Path(snakemake.output.table),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
