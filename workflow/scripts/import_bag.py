"""Convert a bag into the raw layout."""

from pathlib import Path

from card.artifacts import logged
from card.recording.bag.import_bag import import_bag

with logged(Path(snakemake.log[0])):
    import_bag(
        recording=Path(snakemake.params.recording),
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
    )
