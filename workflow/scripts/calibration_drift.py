"""Compare the calibration sessions of a drive day."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.drift import measure_drift

with logged(Path(snakemake.log[0])):
    measure_drift(
        bundles=[Path(bundle) for bundle in snakemake.input.bundles],
        drift=Path(snakemake.output.drift),
        report=Path(snakemake.output.report),
        gates=snakemake.params.cfg["gates"],
    )
