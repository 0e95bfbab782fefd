"""Take over a delivered trajectory and anchor it in the world frame."""

from pathlib import Path

from card.artifacts import logged
from card.poses.import_trajectory import import_trajectory

with logged(Path(snakemake.log[0])):
    import_trajectory(
        delivered=Path(snakemake.input.delivered),
        recording=Path(snakemake.params.recording),
        calibration=Path(snakemake.input.calibration),
        bursts=Path(snakemake.input.bursts),
        frames=Path(snakemake.input.frames),
        trajectory=Path(snakemake.output.trajectory),
        poses=Path(snakemake.output.poses),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
