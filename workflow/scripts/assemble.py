"""Assemble the release tree of one licence."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.assemble import assemble

records = [Path(path).parent for path in snakemake.input.records if path.endswith("release.json")]
splits = {Path(path).parent.name: Path(path) for path in snakemake.input.splits}

with logged(Path(snakemake.log[0])):
    assemble(
        repository=snakemake.wildcards.repository,
        spdx=snakemake.params.spdx,
        terms=snakemake.params.terms,
        sequences=[
            {"id": name, "package": Path(package).parent, "splits": splits.get(name)}
            for name, package in zip(snakemake.params.sequences, snakemake.input.packages, strict=True)
        ],
        release_folder=Path(snakemake.input.changelog).parent,
        split_report=Path(snakemake.input.split_report),
        takedowns=snakemake.params.takedowns,
        reviews=snakemake.params.reviews,
        records=records,
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        **snakemake.params.cfg,
    )
