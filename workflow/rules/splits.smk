# Needs: labels, frames and poses of a sequence, its rows of the committed ledger.
# Makes: results/{id}/splits.parquet, a report a tree, commercial lists. The ledger grows only by assign_splits.
SPLIT_LISTS = {
    split: f"{RELEASE}/commercial-{split}.txt"
    for split in ("train", "validation", "test", "zero_shot")
}


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
        cfg=cfg("splits", "frame_step", "frame_offset"),
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
        poses=expand(
            rules.poses.output.poses,
            id=ids(lambda s: has(s, "camera_left") and has_poses(s)),
        ),
        anchors=SETTINGS["anchors"],
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


rule split_report:
    input:
        splits=tree_splits,
        poses=tree_poses,
        anchors=SETTINGS["anchors"],
    output:
        leakage=f"{RELEASE}/{{repository}}.leakage.parquet",
        balance=f"{RELEASE}/{{repository}}.balance.parquet",
        report=f"{RELEASE}/{{repository}}.splits.report.json",
    log:
        "logs/release/{repository}.splits.log",
    params:
        cfg=cfg("splits"),
        code=code("split_report"),
        places=lambda wildcards: {
            sequence.id: sequence.place for sequence in in_tree(wildcards.repository)
        },
    script:
        "../scripts/split_report.py"


rule split_lists:
    input:
        commercial_splits,
    output:
        **SPLIT_LISTS,
    log:
        "logs/release/split_lists.log",
    params:
        code=code("split_lists"),
        cfg=commercial_sequences,
    script:
        "../scripts/split_lists.py"
