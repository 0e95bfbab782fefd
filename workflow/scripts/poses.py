"""Check the trajectory of a drive, estimated or delivered, and anchor it in the world frame."""

from pathlib import Path

from card.artifacts import logged
from card.poses.import_trajectory import import_trajectory
from card.poses.take_refined import take_refined

estimated = snakemake.params.cfg["settings"]["mode"] == "estimate"
read, source = (take_refined, "refined") if estimated else (import_trajectory, "delivered")

with logged(Path(snakemake.log[0])):
    read(
        **{source: Path(snakemake.input[source])},
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
