# Needs: the raw images of both cameras, what a person labelled and reviewed; poses and sweeps to carry boxes on.
# Makes: results/{id}/anonymized/ and regions/, the only places later rules take images from; a page to audit it.


rule privacy_search:
    input:
        inventory=rules.ingest.output.inventory,
        frames=rules.ingest.output.frames,
    output:
        images="results/{id}/privacy_search/searched_images.parquet",
        detections="results/{id}/privacy_search/detections.parquet",
        report="results/{id}/privacy_search.report.json",
    log:
        "logs/{id}/privacy_search.log",
    priority: 1
    threads: 2
    params:
        cfg=cfg(
            "privacy",
            "embedded",
            "models",
            "tile_px",
            "tile_overlap_px",
            "face",
            "plate",
        ),
        code=code("privacy_search"),
        recording=recording_folder,
        out=subpath(output.images, parent=True),
    script:
        "../scripts/privacy_search.py"


rule privacy:
    input:
        unpack(privacy_sight),
        inventory=rules.ingest.output.inventory,
        frames=rules.ingest.output.frames,
        detections=rules.privacy_search.output.detections,
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
        raw=raw_fingerprint(raw_folder, "privacy_labels.csv", "privacy_review.csv"),
        recording=recording_folder,
        reviewed=raw_folder,
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


rule privacy_audit:
    input:
        inventory=rules.privacy.output.inventory,
        privacy_report=rules.privacy.output.report,
        labels=rules.annotations.output.labels,
    output:
        page="results/{id}/privacy_audit/index.html",
        touched="results/{id}/privacy_audit/redacted_irregularities.parquet",
    log:
        "logs/{id}/privacy_audit.log",
    params:
        cfg=cfg("privacy", "audit"),
        code=code("privacy_audit"),
        anonymized=subpath(input.inventory, parent=True),
        out=subpath(output.page, parent=True),
    script:
        "../scripts/privacy_audit.py"
