# Needs: the label tool's files and the frames they belong to.
# Makes: results/{id}/labels.parquet, label_states.parquet and the list of issues.


rule annotations:
    input:
        frames=rules.ingest.output.frames,
        ingest_report=rules.ingest.output.report,
    output:
        labels="results/{id}/labels.parquet",
        label_states="results/{id}/label_states.parquet",
        issues="results/{id}/annotation_issues.parquet",
        report="results/{id}/annotations.report.json",
    log:
        "logs/{id}/annotations.log",
    params:
        cfg=cfg("annotations"),
        code=code("annotations"),
        row=row("off_road"),
        raw=raw_fingerprint(raw_folder, "annotations"),
        annotations=lambda wildcards: f"{raw_folder(wildcards)}/annotations",
    script:
        "../scripts/annotations.py"
