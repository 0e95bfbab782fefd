# Needs: labels and frames of a sequence, its rows of the committed ledger.
# Makes: results/{id}/splits.parquet. The ledger itself grows only by the target assign_splits.


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
        row=row("id", "place", "role", "off_road"),
        rows=lambda wildcards: ledger_rows({wildcards.id}),
    script:
        "../scripts/splits.py"


rule assign_splits:
    # The committed ledger is not a result: this rule makes no file and runs whenever it is asked for.
    input:
        frames=expand(
            rules.ingest.output.frames, id=ids(lambda s: has(s, "camera_left"))
        ),
        labels=expand(
            rules.annotations.output.labels, id=ids(lambda s: has(s, "camera_left"))
        ),
    log:
        "logs/assign_splits.log",
    params:
        cfg=cfg("splits"),
        ledger=SETTINGS["splits_ledger"],
        sequences=[
            SEQUENCES[name].as_dict() for name in ids(lambda s: has(s, "camera_left"))
        ],
    script:
        "../scripts/assign_splits.py"
