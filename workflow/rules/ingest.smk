# Needs: a recording in the raw layout or as a bag, the sheet's row, the ledger of frame numbers.
# Makes: results/{id}/frames.parquet, bursts.parquet, inventory.parquet; for a bag also results/{id}/recording/.


rule import_bag:
    input:
        description=lambda wildcards: f"{raw_folder(wildcards)}/recording.yaml",
    output:
        description="results/{id}/recording/recording.yaml",
        report="results/{id}/import_bag.report.json",
    log:
        "logs/{id}/import_bag.log",
    priority: 1
    params:
        cfg=cfg("ingest"),
        code=code("import_bag"),
        raw=raw_bag_fingerprint,
        recording=raw_folder,
        out=subpath(output.description, parent=True),
    script:
        "../scripts/import_bag.py"


rule ingest:
    input:
        description=lambda wildcards: f"{recording_folder(wildcards)}/recording.yaml",
    output:
        frames="results/{id}/frames.parquet",
        bursts="results/{id}/bursts.parquet",
        inventory="results/{id}/inventory.parquet",
        report="results/{id}/ingest.report.json",
    log:
        "logs/{id}/ingest.log",
    priority: 1
    params:
        cfg=cfg("ingest"),
        code=code("ingest"),
        row=row("id", "modalities"),
        raw=raw_fingerprint(
            recording_folder, *CAMERAS, *LIDARS, "imu.parquet", "recording.yaml"
        ),
        recording=recording_folder,
        ledger=f"{RAW}/ledger/frames/{{id}}.tsv",
    script:
        "../scripts/ingest.py"
