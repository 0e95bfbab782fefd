"""Report leakage and balance of the splits of one tree."""

from pathlib import Path

from card.artifacts import logged
from card.splits.report import report_splits

poses = {Path(path).parent.name: path for path in snakemake.input.poses}
splits = {Path(path).parent.name: path for path in snakemake.input.splits}

with logged(Path(snakemake.log[0])):
    report_splits(
        sequences=[
            {"id": name, "place": snakemake.params.places[name], "splits": path, "poses": poses.get(name)}
            for name, path in splits.items()
        ],
        anchors=Path(snakemake.input.anchors),
        leakage=Path(snakemake.output.leakage),
        balance=Path(snakemake.output.balance),
        report=Path(snakemake.output.report),
        settings=snakemake.params.cfg["settings"],
        gates=snakemake.params.cfg["gates"],
    )
