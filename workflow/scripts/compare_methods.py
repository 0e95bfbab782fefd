"""Put the evaluations of all methods on one release tree side by side."""

from pathlib import Path

from card.artifacts import logged
from card.benchmark.compare import compare
from card.benchmark.figures import draw_figures
from card.benchmark.frames import Method

with logged(Path(snakemake.log[0])):
    output, given = snakemake.output, snakemake.params.methods
    evaluations = [Path(path).parent for path in snakemake.input.evaluations]
    methods = [Method(name, Path(m["predictions"]), m["space"], m["unit_m"]) for name, m in given.items()]
    paths = {name: Path(output[name]) for name in ("table", "tex", "report")}
    compare(evaluations=evaluations, out=Path(output.comparison), **paths)
    draw_figures(
        release=Path(snakemake.params.tree),
        split=next(iter(given.values()))["split"],
        methods=methods,
        evaluations=evaluations,
        out=Path(snakemake.params.figures),
    )
