"""Search the images of a sequence for faces and plates."""

from pathlib import Path

from card.artifacts import logged
from card.privacy.search import search

with logged(Path(snakemake.log[0])):
    search(
        recording=Path(snakemake.params.recording),
        frames=Path(snakemake.input.frames),
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        threads=snakemake.threads,
    )
