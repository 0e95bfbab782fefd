# Needs: the bundle of the sequence's session, delivered or estimated, and the mask in the session's raw folder.
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
        cfg=calibration_cfg,
        code=code("calibration"),
        session=raw_session,
        raw=lambda wildcards: fingerprint(
            Path(raw_session(wildcards), "ego_mask.png"),
            Path("results", wildcards.id, "fingerprints", "ego_mask.json"),
        ),
    script:
        "../scripts/calibration.py"
