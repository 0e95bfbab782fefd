"""Show what was redacted in a sequence."""

from pathlib import Path

from card.artifacts import logged
from card.privacy.audit import audit

with logged(Path(snakemake.log[0])):
    audit(
        anonymized=Path(snakemake.params.anonymized),
        labels=Path(snakemake.input.labels),
        privacy_report=Path(snakemake.input.privacy_report),
        out=Path(snakemake.params.out),
        settings=snakemake.params.cfg["settings"]["audit"],
    )
