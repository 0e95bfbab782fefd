"""Estimate the motion of a drive, sweep by sweep."""

from pathlib import Path

from card.artifacts import logged
from card.poses.estimate_odometry import estimate_odometry

with logged(Path(snakemake.log[0])):
    estimate_odometry(
        recording=Path(snakemake.params.recording),
        calibration=Path(snakemake.input.calibration),
        bursts=Path(snakemake.input.bursts),
        odometry=Path(snakemake.output.odometry),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
