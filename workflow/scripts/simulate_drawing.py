"""Draw the simulated car."""

from pathlib import Path

from card.artifacts import logged
from card.simulation.drawing import write_drawing

with logged(Path(snakemake.log[0])):
    write_drawing(Path(snakemake.output.drawing), scale=snakemake.params.cfg["scale"])
