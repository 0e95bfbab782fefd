"""Run a user's detector on the sampled frames of a sequence."""

from pathlib import Path

from card.annotations.loop.propose import propose
from card.artifacts import logged

with logged(Path(snakemake.log[0])):
    propose(
        images=Path(snakemake.input.images),
        frames=Path(snakemake.input.frames),
        sample=Path(snakemake.params.sample),
        rows=snakemake.params.rows,
        way=snakemake.wildcards.way,
        detector=snakemake.params.detector,
        detections=Path(snakemake.output.detections),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        sequence=snakemake.wildcards.id,
    )
