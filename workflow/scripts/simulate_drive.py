"""Simulate one drive as a recording."""

from pathlib import Path

from card.artifacts import logged
from card.simulation.simulate import simulate_drive

with logged(Path(snakemake.log[0])):
    simulate_drive(
        snakemake.wildcards.drive,
        recording=Path(snakemake.params.recording),
        truth=Path(snakemake.params.truth),
        scale=snakemake.params.cfg["scale"],
        seed=snakemake.params.cfg["seed"],
        dual_returns=snakemake.params.cfg["dual_returns"],
        threads=snakemake.threads,
    )
