"""Score the predictions of one method on one release tree."""

from pathlib import Path

from card.artifacts import logged
from card.benchmark.evaluate import evaluate

with logged(Path(snakemake.log[0])):
    evaluate(
        release=Path(snakemake.params.tree),
        split=snakemake.params.split,
        method=snakemake.wildcards.method,
        predictions=Path(snakemake.params.predictions),
        out=Path(snakemake.output.scores),
        table=Path(snakemake.output.table),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
