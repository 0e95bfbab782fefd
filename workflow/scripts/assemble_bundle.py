"""Put the calibration bundle of a session together."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.bundle import assemble_bundle

with logged(Path(snakemake.log[0])):
    assemble_bundle(
        session=snakemake.wildcards.session,
        front_lidar=Path(snakemake.input.front_lidar),
        rear_and_imu=Path(snakemake.input.rear_and_imu),
        rig_wheels=Path(snakemake.input.rig_wheels[0]),
        drawing=Path(snakemake.input.drawing),
        calibration=Path(snakemake.output.calibration),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
