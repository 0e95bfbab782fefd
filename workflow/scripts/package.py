"""Pack one sequence into shards, tables and sidecars."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.pack import pack_sequence

found = {name: Path(path) for name, path in snakemake.input.items()}
recording = Path(snakemake.params.recording)
sensors = set(snakemake.params.row["modalities"])


def sensor(name: str, file: str) -> Path | None:
    """A raw folder or file of the recording, if the sequence has that sensor."""
    return recording / file if name in sensors else None


def folder(name: str) -> Path | None:
    """The folder of a stage that describes it by an inventory."""
    return found[f"{name}_inventory"].parent if f"{name}_inventory" in found else None


with logged(Path(snakemake.log[0])):
    pack_sequence(
        sequence=snakemake.params.row,
        spdx=snakemake.params.spdx,
        frames=found["ingest_frames"],
        bursts=found["ingest_bursts"],
        recording_inventory=found["ingest_inventory"],
        lidar_front=sensor("lidar_front", "lidar_front"),
        lidar_rear=sensor("lidar_rear", "lidar_rear"),
        imu=sensor("imu", "imu.parquet"),
        calibration=found.get("calibration_calibration"),
        poses=found.get("poses_poses"),
        wheel_excitation=found.get("wheels_wheel_excitation"),
        road_planes=found.get("wheels_road_planes"),
        ground_truth=folder("ground_truth"),
        anonymized=folder("privacy"),
        labels=found.get("annotations_labels"),
        label_states=found.get("annotations_label_states"),
        reports={
            stage: found[f"{stage}_report"] for stage in snakemake.params.stages if f"{stage}_report" in found
        },
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
