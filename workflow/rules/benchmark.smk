# Needs: validated trees; for each method a folder <repository>/<sequence>/<frame:06d>.{npz,npy,png,exr} of depth maps.
# Makes: results/benchmark/{method}/{repository}/: evaluation, tables as Markdown and Parquet.


rule evaluate:
    input:
        sums=rules.assemble.output.sums,
        validation=rules.validate_tree.output.validation,
    output:
        evaluation="results/benchmark/{method}/{repository}/evaluation.json",
        table="results/benchmark/{method}/{repository}/table.md",
        parquet=[
            f"results/benchmark/{{method}}/{{repository}}/{name}.parquet"
            for name in ("frames", "boxes", "distances")
        ],
        report="results/benchmark/{method}/{repository}.report.json",
    log:
        "logs/benchmark/{method}/{repository}.log",
    params:
        cfg=cfg("benchmark", *PROTOCOL),
        code=code("evaluate"),
        method=method_of,
        raw=predictions_fingerprint,
        tree=subpath(input.sums, parent=True),
        out=subpath(output.evaluation, parent=True),
    script:
        "../scripts/evaluate.py"


rule benchmark:
    input:
        evaluations,
