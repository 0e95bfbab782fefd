# Needs: the raw images of both cameras and, for the recall gate, what a person labelled in some of them.
# Makes: results/{id}/anonymized/ and results/{id}/regions/, the only places later rules take images from.


rule privacy:
    input:
        inventory=rules.ingest.output.inventory,
        frames=rules.ingest.output.frames,
    output:
        images="results/{id}/anonymized/images.parquet",
        redactions="results/{id}/anonymized/redactions.parquet",
        inventory="results/{id}/anonymized/inventory.parquet",
        report="results/{id}/privacy.report.json",
    log:
        "logs/{id}/privacy.log",
    params:
        cfg=privacy_cfg,
        code=code("privacy"),
        raw=raw_fingerprint(raw_folder, "privacy_labels.csv"),
        recording=recording_folder,
        labelled=lambda wildcards: f"{raw_folder(wildcards)}/privacy_labels.csv",
        out=subpath(output.images, parent=True),
    script:
        "../scripts/privacy.py"


rule regions:
    # Only for sequences with takedowns of image regions.
    input:
        anonymized=rules.privacy.output.inventory,
        frames=rules.ingest.output.frames,
    output:
        inventory="results/{id}/regions/inventory.parquet",
        report="results/{id}/regions.report.json",
    log:
        "logs/{id}/regions.log",
    params:
        cfg=takedowns_of,
        code=code("regions"),
        out=subpath(output.inventory, parent=True),
    script:
        "../scripts/regions.py"
