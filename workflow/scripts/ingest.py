"""Check a recording and list its frames and bursts."""

from pathlib import Path

from card.artifacts import logged
from card.recording.ingest import ingest

with logged(Path(snakemake.log[0])):
    ingest(
        recording=Path(snakemake.params.recording),
        sequence=snakemake.params.row,
        ledger=Path(snakemake.params.ledger),
        frames=Path(snakemake.output.frames),
        bursts=Path(snakemake.output.bursts),
        inventory=Path(snakemake.output.inventory),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
