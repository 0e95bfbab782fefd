# Needs: labels and frames of a sequence, its rows of the committed ledger.
# Makes: results/{id}/splits.parquet. The ledger itself grows only by the target assign_splits.
from card.splits.ledger import read_ledger

LEDGER = read_ledger(Path(SETTINGS["splits_ledger"]))


rule splits:
    input:
        frames=rules.ingest.output.frames,
        labels=rules.annotations.output.labels,
        label_states=rules.annotations.output.label_states,
    output:
        splits="results/{id}/splits.parquet",
        report="results/{id}/splits.report.json",
    log:
        "logs/{id}/splits.log",
    params:
        cfg=cfg("splits"),
        code=code("splits"),
        row=row,
        rows=lambda wildcards: [line for line in LEDGER if line["sequence"] == wildcards.id],
    script:
        "../scripts/splits.py"


rule assign_splits:
    input:
        labels=expand(rules.annotations.output.labels, id=ids(lambda s: has(s, "camera_left"))),
    output:
        proposal="results/splits_ledger.tsv",
    log:
        "logs/assign_splits.log",
    params:
        cfg=cfg("splits"),
        code=code("assign_splits"),
        ledger=SETTINGS["splits_ledger"],
        sequences=[SEQUENCES[name].as_dict() for name in ids(lambda s: has(s, "camera_left"))],
    script:
        "../scripts/assign_splits.py"
