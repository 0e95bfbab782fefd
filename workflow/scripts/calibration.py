"""Take over the calibration bundle of a sequence's session."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.import_bundle import import_bundle

with logged(Path(snakemake.log[0])):
    import_bundle(
        session=Path(snakemake.params.session),
        calibration=Path(snakemake.output.calibration),
        ego_mask=Path(snakemake.output.ego_mask),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
