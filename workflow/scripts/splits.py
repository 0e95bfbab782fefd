"""Give every frame of a sequence its split."""

from pathlib import Path

from card.artifacts import logged
from card.splits.assign import assign

with logged(Path(snakemake.log[0])):
    assign(
        sequence=snakemake.params.row,
        frames=Path(snakemake.input.frames),
        labels=Path(snakemake.input.labels),
        label_states=Path(snakemake.input.label_states),
        rows=snakemake.params.rows,
        splits=Path(snakemake.output.splits),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
