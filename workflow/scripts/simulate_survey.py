"""Simulate the Leica survey of one drive day."""

from pathlib import Path

from card.artifacts import logged
from card.simulation.survey import simulate_survey

with logged(Path(snakemake.log[0])):
    simulate_survey(
        snakemake.wildcards.day,
        folder=Path(snakemake.params.folder),
        truth=Path(snakemake.params.truth),
        scale=snakemake.params.cfg["scale"],
        seed=snakemake.params.cfg["seed"],
    )
