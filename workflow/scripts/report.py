"""Write the report page of a release."""

from pathlib import Path

from card.artifacts import logged
from card.report.page import page

with logged(Path(snakemake.log[0])):
    page(
        results=Path("results"),
        sequences=snakemake.params.sequences,
        release=[Path(str(path).removesuffix(".validation.json")) for path in snakemake.input.validations],
        out=Path(snakemake.params.out),
    )
