"""Anonymize the images of a sequence."""

from pathlib import Path

from card.artifacts import logged
from card.privacy.anonymize import anonymize

inputs = {name: Path(path) for name, path in snakemake.input.items()}
sight = {name: inputs[name] for name in ("calibration", "trajectory", "bursts") if name in inputs}

with logged(Path(snakemake.log[0])):
    anonymize(
        recording=Path(snakemake.params.recording),
        frames=Path(snakemake.input.frames),
        detections=Path(snakemake.input.detections).parent,
        sight=sight,
        labelled=Path(snakemake.params.reviewed, "privacy_labels.csv"),
        reviews=Path(snakemake.params.reviewed, "privacy_review.csv"),
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        threads=snakemake.threads,
    )
