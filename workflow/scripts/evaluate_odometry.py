"""Score the trajectories of one method on one release tree."""

from pathlib import Path

from card.artifacts import logged
from card.benchmark.odometry import evaluate_odometry

with logged(Path(snakemake.log[0])):
    evaluate_odometry(
        release=Path(snakemake.params.tree),
        split=snakemake.params.method["split"],
        method=snakemake.wildcards.method,
        predictions=Path(snakemake.params.method["predictions"]),
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
