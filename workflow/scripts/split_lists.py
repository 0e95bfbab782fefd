"""List the frames of each split that may be used commercially."""

from pathlib import Path

from card.artifacts import logged
from card.splits.report import write_lists

tables = {Path(path).parent.name: Path(path) for path in snakemake.input}

with logged(Path(snakemake.log[0])):
    write_lists(
        {
            repository: {name: tables[name] for name in names}
            for repository, names in snakemake.params.cfg.items()
        },
        {split: Path(path) for split, path in snakemake.output.items()},
    )
