"""Compare the proposals of a sequence with the labels that came back."""

from pathlib import Path

from card.annotations.loop.review import review_proposals
from card.artifacts import logged

with logged(Path(snakemake.log[0])):
    review_proposals(
        detections=Path(snakemake.input.detections),
        detections_report=Path(snakemake.input.detections_report),
        labels=Path(snakemake.input.labels),
        label_states=Path(snakemake.input.label_states),
        ingest_report=Path(snakemake.input.ingest_report),
        rows=snakemake.params.rows,
        review=Path(snakemake.output.review),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
