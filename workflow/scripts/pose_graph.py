"""Refine the odometry of a drive in one batch."""

from pathlib import Path

from card.artifacts import logged
from card.poses.pose_graph import refine_odometry

with logged(Path(snakemake.log[0])):
    refine_odometry(
        recording=Path(snakemake.params.recording),
        calibration=Path(snakemake.input.calibration),
        bursts=Path(snakemake.input.bursts),
        odometry=Path(snakemake.input.odometry),
        trajectory=Path(snakemake.output.trajectory),
        nodes=Path(snakemake.output.nodes),
        loops=Path(snakemake.output.loops),
        g2o=Path(snakemake.output.g2o),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        odometry_settings=snakemake.params.odometry,
        gates=snakemake.params.cfg["gates"],
    )
