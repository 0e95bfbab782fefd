"""Fill regions of anonymized images that were taken down."""

from pathlib import Path

from card.artifacts import logged
from card.privacy.regions import fill_regions

with logged(Path(snakemake.log[0])):
    fill_regions(
        anonymized=Path(snakemake.input.anonymized).parent,
        frames=Path(snakemake.input.frames),
        takedowns=snakemake.params.cfg,
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
    )
