"""Estimate the rear LiDAR and the IMU of a session from its short drive."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.rear_and_imu import calibrate_rear_and_imu

with logged(Path(snakemake.log[0])):
    calibrate_rear_and_imu(
        drive=Path(snakemake.params.drive),
        front_lidar=Path(snakemake.input.front_lidar),
        drawing=Path(snakemake.input.drawing),
        rear_and_imu=Path(snakemake.output.rear_and_imu),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        odometry_settings=snakemake.params.odometry,
        gates=snakemake.params.cfg["gates"],
        threads=snakemake.threads,
    )
