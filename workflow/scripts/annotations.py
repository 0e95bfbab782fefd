"""Import the labels of a sequence."""

from pathlib import Path

from card.annotations.import_labels import import_labels
from card.artifacts import logged

with logged(Path(snakemake.log[0])):
    import_labels(
        annotations=Path(snakemake.params.annotations),
        frames=Path(snakemake.input.frames),
        ingest_report=Path(snakemake.input.ingest_report),
        off_road=snakemake.params.row["off_road"],
        labels=Path(snakemake.output.labels),
        label_states=Path(snakemake.output.label_states),
        issues=Path(snakemake.output.issues),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
