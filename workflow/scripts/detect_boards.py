"""Find the board in the images of a calibration session or survey."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.detect_boards import detect_boards

with logged(Path(snakemake.log[0])):
    detect_boards(
        session=Path(snakemake.params.session),
        boards=Path(snakemake.output.boards),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        threads=snakemake.threads,
    )
