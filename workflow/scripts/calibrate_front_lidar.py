"""Calibrate the front LiDAR with the cameras from the board views of a session."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.front_lidar import calibrate_front_lidar

with logged(Path(snakemake.log[0])):
    calibrate_front_lidar(
        session=Path(snakemake.params.session),
        boards=Path(snakemake.input.boards),
        cameras=Path(snakemake.input.cameras),
        board=Path(snakemake.input.board),
        drawing=Path(snakemake.input.drawing),
        front_lidar=Path(snakemake.output.front_lidar),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
