"""Fit the wheel excitation and the road plane a frame."""

from pathlib import Path

from card.artifacts import logged
from card.wheels.excitation import excite

with logged(Path(snakemake.log[0])):
    excite(
        recording=Path(snakemake.params.recording),
        bursts=Path(snakemake.input.bursts),
        frames=Path(snakemake.input.frames),
        calibration=Path(snakemake.input.calibration),
        trajectory=Path(snakemake.input.trajectory),
        static_voxels=Path(snakemake.input.static_voxels),
        wheel_excitation=Path(snakemake.output.wheel_excitation),
        road_planes=Path(snakemake.output.road_planes),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        threads=snakemake.threads,
    )
