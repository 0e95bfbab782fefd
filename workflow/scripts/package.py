"""Pack one sequence into shards, tables and sidecars."""

from pathlib import Path

from card.artifacts import logged
from card.packaging.pack import pack_sequence

inputs = {name: Path(path) for name, path in (*snakemake.input.items(), *snakemake.params.raw.items())}
reports = {
    name.removesuffix("_report"): inputs.pop(name) for name in list(inputs) if name.endswith("_report")
}
# A folder is tracked by the inventory inside.
inputs |= {name: inputs[name].parent for name in ("ground_truth", "anonymized", "regions") if name in inputs}

with logged(Path(snakemake.log[0])):
    pack_sequence(
        sequence=snakemake.params.row,
        spdx=snakemake.params.spdx,
        reports=reports,
        out=Path(snakemake.params.out),
        report=Path(snakemake.output.report),
        takedowns=snakemake.params.takedowns,
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
        **inputs,
    )
