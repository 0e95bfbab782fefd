"""Take over the calibration bundle of a sequence's session, estimated or delivered."""

from pathlib import Path

from card.artifacts import logged
from card.calibration.import_bundle import import_bundle
from card.calibration.take_estimated import take_estimated

estimated = snakemake.params.cfg["settings"]["mode"] == "estimate"
read, source = (take_estimated, {"bundle": snakemake.input.bundle}) if estimated else (import_bundle, {})

with logged(Path(snakemake.log[0])):
    read(
        **{name: Path(path) for name, path in source.items()},
        session=Path(snakemake.params.session),
        calibration=Path(snakemake.output.calibration),
        ego_mask=Path(snakemake.output.ego_mask),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
