"""Show what the upload of each validated tree would do, or send it."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.upload import upload

with logged(Path(snakemake.log[0])):
    for validation in snakemake.input.trees:
        lines = upload(
            tree=Path(validation.removesuffix(".validation.json")),
            records=Path(snakemake.params.records),
            settings=snakemake.params.cfg["settings"],
            really=snakemake.params.really,
        )
        print("\n".join(lines), flush=True)
