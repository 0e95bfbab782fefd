"""Score the depth maps of one method on one release tree."""

from pathlib import Path

from card.artifacts import logged
from card.benchmark.evaluate import evaluate
from card.benchmark.frames import Method

with logged(Path(snakemake.log[0])):
    given = snakemake.params.method
    evaluate(
        release=Path(snakemake.params.tree),
        split=given["split"],
        method=Method(
            snakemake.wildcards.method, Path(given["predictions"]), given["space"], given["unit_m"]
        ),
        task=given["task"],
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
