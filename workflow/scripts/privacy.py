"""Anonymize the images of a sequence."""

from pathlib import Path

from card.artifacts import logged
from card.privacy.anonymize import anonymize

with logged(Path(snakemake.log[0])):
    anonymize(
        recording=Path(snakemake.params.recording),
        frames=Path(snakemake.input.frames),
        labelled=Path(snakemake.params.labelled),
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        threads=snakemake.threads,
    )
