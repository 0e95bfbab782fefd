"""Link the labels of a sequence to its ground truth."""

from pathlib import Path

from card.artifacts import logged
from card.irregularities.link import link_irregularities

with logged(Path(snakemake.log[0])):
    link_irregularities(
        labels=Path(snakemake.input.labels),
        frames=Path(snakemake.input.frames),
        calibration=Path(snakemake.input.calibration),
        trajectory=Path(snakemake.input.trajectory),
        ground_truth=Path(snakemake.input.ground_truth).parent,
        road_planes=Path(snakemake.input.road_planes),
        irregularities=Path(snakemake.output.irregularities),
        tracks=Path(snakemake.output.tracks),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
