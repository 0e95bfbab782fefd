"""See that trees of different licences share nothing."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.firewall import check_firewall

with logged(Path(snakemake.log[0])):
    check_firewall(
        [Path(path).parent for path in snakemake.input.sums],
        snakemake.params.cfg,
        Path(snakemake.output.report),
    )
