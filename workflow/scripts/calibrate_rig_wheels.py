"""Calibrate the wheels of a drive day from its Leica surveys."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.rig_wheels import calibrate_rig_wheels

with logged(Path(snakemake.log[0])):
    calibrate_rig_wheels(
        survey=Path(snakemake.params.survey),
        boards=Path(snakemake.input.boards),
        front_lidar=Path(snakemake.input.front_lidar),
        board=Path(snakemake.input.board),
        rig_wheels=Path(snakemake.output.rig_wheels),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
