"""Aggregate the quasi-dense ground truth of a sequence."""

from pathlib import Path

from card.artifacts import logged
from card.ground_truth.aggregate import aggregate

with logged(Path(snakemake.log[0])):
    aggregate(
        recording=Path(snakemake.params.recording),
        bursts=Path(snakemake.input.bursts),
        frames=Path(snakemake.input.frames),
        calibration=Path(snakemake.input.calibration),
        ego_mask=Path(snakemake.input.ego_mask),
        trajectory=Path(snakemake.input.trajectory),
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        threads=snakemake.threads,
        anonymized=next((Path(path).parent for path in snakemake.input.anonymized), None),
    )
