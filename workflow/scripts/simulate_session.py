"""Simulate one calibration session."""

from pathlib import Path

from card.artifacts import logged
from card.simulation.sessions import simulate_session

with logged(Path(snakemake.log[0])):
    simulate_session(
        snakemake.wildcards.simulated,
        folder=Path(snakemake.params.folder),
        truth=Path(snakemake.params.truth),
        scale=snakemake.params.cfg["scale"],
        seed=snakemake.params.cfg["seed"],
        threads=snakemake.threads,
    )
