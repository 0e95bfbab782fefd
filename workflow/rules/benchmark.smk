# Needs: validated trees; for each method a folder <repository>/<sequence>/<frame:06d>.npy of depth maps in metres.
# Makes: results/benchmark/{method}/{repository}.json and .md.


rule evaluate:
    input:
        sums=rules.assemble.output.sums,
        validation=rules.validate_tree.output.validation,
    output:
        scores="results/benchmark/{method}/{repository}.json",
        table="results/benchmark/{method}/{repository}.md",
        report="results/benchmark/{method}/{repository}.report.json",
    log:
        "logs/benchmark/{method}/{repository}.log",
    params:
        cfg=cfg(
            "benchmark", "profile", "min_depth_m", "max_depth_m", "height_thresholds_m"
        ),
        code=code("evaluate"),
        raw=lambda wildcards: fingerprint(
            predictions(wildcards),
            Path(
                "results",
                "benchmark",
                wildcards.method,
                f"{wildcards.repository}.fingerprint.json",
            ),
        ),
        tree=subpath(input.sums, parent=True),
        split=SETTINGS["benchmark"]["split"],
        predictions=lambda wildcards: str(predictions(wildcards)),
    script:
        "../scripts/evaluate.py"


rule benchmark:
    input:
        evaluations,
