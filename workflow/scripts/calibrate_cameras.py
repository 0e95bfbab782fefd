"""Calibrate both cameras from the board views of a session."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.cameras import calibrate_cameras

with logged(Path(snakemake.log[0])):
    calibrate_cameras(
        boards=Path(snakemake.input.boards),
        board=Path(snakemake.input.board),
        cameras=Path(snakemake.output.cameras),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
