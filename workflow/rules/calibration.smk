# Needs: the calibration session that the sheet names.
# Makes: results/{id}/calibration.json and ego_mask.png.


rule calibration:
    input:
        bundle=session_bundle,
    output:
        calibration="results/{id}/calibration.json",
        ego_mask="results/{id}/ego_mask.png",
        report="results/{id}/calibration.report.json",
    log:
        "logs/{id}/calibration.log",
    priority: 1
    params:
        cfg=cfg("calibration"),
        code=code("calibration"),
        session=subpath(input.bundle, parent=True),
        raw=lambda wildcards: fingerprint(
            Path(session_bundle(wildcards)).with_name("ego_mask.png"),
            Path("results", wildcards.id, "fingerprints", "ego_mask.json"),
        ),
    script:
        "../scripts/calibration.py"
